"""The snippets of the guide's pages on Python run as they are printed."""

import re
import shutil

import pytest

from conftest import ROOT


@pytest.mark.parametrize(
    ("page", "packages", "programs"), [("index", [], []), ("python", [], []), ("optimise", ["casadi", "jax"], ["cc"])]
)
def test_the_guides_snippets_run(monkeypatch, tmp_path, page, packages, programs):
    for package in packages:
        pytest.importorskip(package)
    for program in programs:
        if shutil.which(program) is None:
            pytest.skip(f"there is no {program}")
    # the first page needs no clone
    monkeypatch.chdir(tmp_path if page == "index" else ROOT)
    text = (ROOT / "runtime" / "guide" / "pages" / f"{page}.md").read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    assert len(blocks) >= (1 if page == "index" else 4)
    space = {}
    for block in blocks:
        exec(compile(block, f"{page}.md", "exec"), space)  # our own page
