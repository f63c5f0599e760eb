"""The package as a whole."""

import pathlib
import re
import shutil
import subprocess
import sys

import pytest

import regen

HERE = pathlib.Path(__file__).resolve().parent
PACKAGE = pathlib.Path(regen.__file__).resolve().parent


def test_the_types_of_options_are_those_of_the_command():
    tool = HERE.parent / "tools" / "options.py"
    done = subprocess.run([sys.executable, str(tool)], capture_output=True, text=True, check=True)
    assert done.stdout == (PACKAGE / "options.py").read_text(), f"run {tool.name} again"


def test_everything_public_is_documented():
    for name in regen.__all__:
        public = getattr(regen, name)
        assert public.__doc__, name
        for member in dir(public) if isinstance(public, type) else ():
            value = getattr(public, member)
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"
    assert "fourier" in regen.Robot.identify.__doc__


def test_types_are_checked_by_mypy(tmp_path):
    pytest.importorskip("mypy")
    # beside other packages, where a wheel puts it, mypy would take those for a part of the checked sources
    sources = shutil.copytree(PACKAGE, tmp_path / "regen", ignore=shutil.ignore_patterns("*.so", "__pycache__"))
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", "pyproject.toml", str(sources)],
        capture_output=True, text=True, check=False, cwd=HERE.parent,
    )
    assert done.returncode == 0, done.stdout


def test_examples_in_documentation():
    import doctest

    from regen import logs, robot

    for module in (regen, logs, robot):
        assert doctest.testmod(module).failed == 0


def test_the_conda_recipe_asks_for_what_the_package_needs():
    recipe = (HERE.parent / "recipe" / "recipe.yaml").read_text()
    project = (HERE.parent / "pyproject.toml").read_text()
    workspace = (HERE.parents[2] / "Cargo.toml").read_text()
    version = re.search(r'^version = "(.*)"$', workspace, re.M)[1]
    assert f'version: "{version}"' in recipe
    name = re.search(r'^name = "(.*)"$', project, re.M)[1]
    assert f"name: {name}\n" in recipe
    python = re.search(r'^requires-python = "(.*)"$', project, re.M)[1]
    needed = re.search(r"^dependencies = \[(.*)\]$", project, re.M)[1].replace('"', "").split(", ")
    built = re.search(r"^requires = \[(.*)\]$", project, re.M)[1].strip('"').split(", ")
    listed = re.findall(r"^    - (.*)$", recipe, re.M)
    for one in [f"python{python}", *needed, *built]:
        assert re.sub(r"([a-z])([><=])", r"\1 \2", one, count=1) in listed, (one, listed)
