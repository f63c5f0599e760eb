"""Messages name arguments and methods of Python."""

import warnings

import numpy as np
import pytest

import regen
from regen._spoken import spoken


@pytest.mark.parametrize(
    ("message", "words"),
    [
        ("use --rest-speed 0.01 or `--no-filter`", "use rest_speed=0.01 or `no_filter`"),
        ("identify with --feasible.", "identify with feasible=True."),
        ("filter: --butterworth 4,20; see", "filter: butterworth=(4, 20); see"),
        ("--pid and --controller both give", "`pid` and `controller` both give"),
        ("'--local <F>' cannot be used with '--fourier <F,H>'", "'local' cannot be used with 'fourier'"),
        (
            "`--column q3=constant:90:deg --column q1=q1:deg`",
            "`column={'q3': 'constant:90:deg', 'q1': 'q1:deg'}`",
        ),
        ("--payload unknown is for `regen identify`", "payload='unknown' is for `Robot.identify()`"),
        ("by `regen import --lock` or", "by `Robot(lock=...)` or"),
        ("gains, for `identify --controller`", "gains, for `Robot.identify(controller=...)`"),
        ("`regen identify --feasible`", "`Robot.identify(feasible=True)`"),
        ("try regen simulate --help", "try help(regen.Robot.simulate)"),
        ("a--feasible -- and --no-such-option 3", "a--feasible -- and --no-such-option 3"),
    ],
)
def test_options_and_commands_are_those_of_python(message, words):
    assert spoken(message) == words


def test_no_error_of_a_method_names_an_option(picker):
    t = np.arange(0, 1, 0.01)
    log = {"t": t, "q1": 2.2 + 0 * t, "q3": 0.94 + 0 * t, "tau_q1": t, "tau_q3": t}
    several = [
        lambda: picker.identify(log, fourier=(1.0, 2), local=0.1),
        lambda: picker.identify(log, payload="carried"),
        lambda: picker.identify(log, butterworth=(4, 400)),
        lambda: picker.identify(log, estimator="iv"),
        lambda: picker.identify(log, no_filter=True),
        lambda: picker.rehearse(butterworth=(4, 20), gain={"q1": 2}, noise=(1e-5, 0.1)),
        lambda: picker.simulate(pid=(1, 2)),
        lambda: picker.excite(limit={"q9.position": (0, 1)}),
    ]
    told = []
    for call in several:
        with warnings.catch_warnings(), pytest.raises(regen.RegenError) as found:
            warnings.simplefilter("ignore")
            call()
        told.append(str(found.value))
    assert not [text for text in told if "--" in text], told
