"""What several tests use."""

import pathlib

import pytest

import regen

ROOT = pathlib.Path(__file__).resolve().parents[3]
ROBOTS = ROOT / "robots"


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory):
    """A cache of the tests' own, that they share."""
    import os

    os.environ["REGEN_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def fivebar():
    """A planar mechanism with one loop."""
    return regen.Robot(ROBOTS / "fivebar.yaml")


@pytest.fixture(scope="session")
def picker():
    """The five-bar of the guide, with friction, limits and nominal values."""
    return regen.Robot(ROOT / "runtime" / "guide" / "fivebar" / "fivebar.yaml")


@pytest.fixture(scope="session")
def scara():
    """An arm without loops."""
    return regen.Robot(ROBOTS / "scara.yaml")
