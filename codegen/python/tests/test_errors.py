"""Mistakes are exceptions with places; interrupts end long work."""

import os
import pickle
import signal
import threading
import time

import pytest

import regen
from conftest import ROBOTS

WRONG = """\
name: arm
limbs:
  - name: arm
    joints:
      - {name: q1, type: prismtic, body: 1, actuated: true}
"""


def test_mistakes_in_descriptions_have_places():
    with pytest.raises(regen.DescriptionError) as found:
        regen.Robot(WRONG)
    mistake = found.value.mistakes[0]
    assert (mistake.line, mistake.column) == (5, 26)
    assert "prismatic" in mistake.message and "^" in str(found.value)
    again = pickle.loads(pickle.dumps(found.value))
    assert again.mistakes == found.value.mistakes and str(again) == str(found.value)


def test_options_that_do_not_exist_or_do_not_fit_are_told(fivebar):
    with pytest.raises(regen.OptionError, match="did you mean 'fourier'"):
        fivebar.identify("x.csv", furier=(1.0, 2))
    with pytest.raises(regen.OptionError, match="True or False"):
        fivebar.identify("x.csv", feasible=3)
    with pytest.raises(regen.OptionError, match="cannot be used with"):
        fivebar.identify("x.csv", fourier=(1.0, 2), local=0.1)


def test_files_that_are_missing_are_told(fivebar):
    with pytest.raises(regen.FileError, match="missing.yaml"):
        regen.Robot("missing.yaml")
    with pytest.raises(regen.RegenError, match="missing.csv"):
        fivebar.identify("missing.csv")
    with pytest.raises(OSError):
        regen.Robot("missing.yaml")


def test_robots_are_pickled(fivebar):
    again = pickle.loads(pickle.dumps(fivebar))
    assert again.digest == fivebar.digest and again.coordinates == fivebar.coordinates


def test_an_interrupt_ends_a_long_search(picker):
    if threading.current_thread() is not threading.main_thread():
        pytest.skip("signals reach the main thread only")
    timer = threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT))
    # a process in the background may begin with interrupts that are ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer.start()
        begin = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            # minutes of work
            picker.excite(steps=100_000, starts=4_000, harmonics=5, frequency=0.2)
        assert time.monotonic() - begin < 20
    finally:
        signal.signal(signal.SIGINT, before)


def test_progress_is_told_and_may_stop_the_work(picker):
    seen = []

    class Enough(Exception):
        pass

    def progress(what, done, of):
        seen.append((what, done, of))
        if len(seen) == 3:
            raise Enough

    with pytest.raises(Enough):
        picker.excite(steps=100_000, starts=4_000, harmonics=5, frequency=0.2, progress=progress)
    assert all(of is None or done <= of for _, done, of in seen)
