"""The snippets of the guide's page on Python run as they are printed."""

import re

from conftest import ROOT


def test_the_guides_snippets_run(monkeypatch):
    monkeypatch.chdir(ROOT)
    page = (ROOT / "runtime" / "guide" / "pages" / "python.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
    assert len(blocks) >= 4
    space = {}
    for block in blocks:
        exec(compile(block, "python.md", "exec"), space)  # our own page
