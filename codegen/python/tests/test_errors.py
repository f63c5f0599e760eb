"""Mistakes are exceptions with places; interrupts end long work."""

import os
import pickle
import signal
import threading
import time
from random import Random

import numpy as np
import pytest

import regen
from conftest import ROBOTS, ROOT

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


def test_what_looks_wrong_is_told_at_the_callers_line_though_the_call_fails(picker):
    run = dict(regen.Log.read(ROOT / "runtime/guide/fivebar/run1.csv"))
    run.update({name: np.degrees(run[name]) for name in ("q1", "q3")})
    with pytest.warns(regen.RegenWarning, match="look in degrees") as shown:
        with pytest.raises(regen.InputError, match="singular") as found:
            picker.identify(run, butterworth=(4, 20))
    # the folder of columns in memory is nobody's business
    assert str(found.value).startswith("columns1.csv")
    assert str(shown[0].message).startswith("columns1.csv")
    assert shown[0].filename == __file__


def test_states_that_are_no_numbers_are_told(picker):
    with pytest.raises(regen.InputError, match="not a finite number"):
        picker.close([[np.nan, 1.0]])


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


def _mutated(text, random):
    """A description with one or two random edits."""
    pieces = ["{", "}", "[", "]", ": ", "\n", ",", "'", "&a ", "*a", "^", "sqrt(", "1e999", "-1", "\0", "\U0001f916"]
    for _ in range(random.randint(1, 2)):
        at = random.randint(0, len(text))
        end = min(len(text), at + random.randint(1, 6))
        match random.randint(0, 3):
            case 0:
                text = text[:at] + text[end:]
            case 1:
                text = text[:at] + text[at:end] * 2 + text[end:]
            case 2:
                text = text[:at] + random.choice(pieces) + text[at:]
            case _:
                text = text[:at] + chr(random.randint(1, 0x2FF)) + text[at + 1 :]
    return text


def test_any_text_is_a_robot_or_an_error_of_ours():
    random = Random(1)
    good = WRONG.replace("prismtic", "prismatic")
    read = refused = 0
    for _ in range(300):
        text = _mutated(good, random)
        try:
            robot = regen.Robot(text)
        except (regen.RegenError, OSError):
            refused += 1
            continue
        read += 1
        assert robot.regressor(*(np.zeros((2, len(robot.coordinates))) for _ in range(3))).shape[0] == 2
    assert read > 5 and refused > 100


def test_any_arrays_are_evaluated_or_refused(scara):
    random = Random(2)
    n = len(scara.coordinates)
    shapes = [(), (0,), (1,), (2,), (n,), (0, n), (3, n), (n, 3), (2, 2, n)]
    kinds = [np.float64, np.float32, np.int64, np.complex128, bool, object, "U3", "datetime64[s]"]
    strange = [None, "q", {}, [[1.0, 2.0], [3.0]], [], float("nan"), b"x", range(n)]
    answered = refused = 0
    for _ in range(600):
        given = []
        for _ in range(3):
            if random.random() < 0.2:
                given.append(random.choice(strange))
            else:
                array = np.zeros((3, n), random.choice(kinds[:3]))
                if random.random() < 0.2:
                    array = np.zeros(random.choice(shapes), random.choice(kinds))
                given.append(array[..., ::-1] if array.ndim else array)
        try:
            tau = scara.inverse_dynamics(*given, phi=np.zeros(len(scara.parameters)))
        except regen.RegenError:
            refused += 1
            continue
        answered += 1
        assert not np.any(tau) and not any(np.iscomplexobj(one) for one in given)
    assert answered > 10 and refused > 100
