"""Robots with closed loops: regressors, base parameters and identification.

>>> import regen
>>> robot = regen.Robot("3rps.yaml")          # doctest: +SKIP
>>> robot.base                                # doctest: +SKIP
>>> robot.identify("runs.yaml").table         # doctest: +SKIP
"""

from . import _call, _native, _spoken
from .base import Base
from .errors import (
    CheckError,
    DescriptionError,
    FileError,
    InputError,
    Mistake,
    NumericError,
    OptionError,
    RegenError,
    RegenWarning,
)
from .fleet import Factors
from .functions import Closed, Derivatives
from .logs import Log
from .results import (
    Calibration,
    Excitation,
    Explanation,
    Identified,
    Inspection,
    Page,
    Rehearsal,
    Report,
    Validation,
)
from .robot import Robot, inspect, new, observe

__version__ = _native.__version__

__all__ = [
    "Base",
    "Calibration",
    "CheckError",
    "Closed",
    "Derivatives",
    "DescriptionError",
    "Excitation",
    "Explanation",
    "Factors",
    "FileError",
    "Identified",
    "InputError",
    "Inspection",
    "Log",
    "Mistake",
    "NumericError",
    "OptionError",
    "Page",
    "RegenError",
    "RegenWarning",
    "Rehearsal",
    "Report",
    "Robot",
    "Validation",
    "inspect",
    "new",
    "observe",
]


def _document() -> None:
    """Adds the options of the command to the documentation of the methods that take them."""
    for name in (
        "equations", "generate", "excite", "simulate", "rehearse", "calibrate", "inspect",
        "identify", "validate", "report", "observe",
    ):
        method = getattr(Robot, name)
        hidden = {"format"} if name != "equations" else set()
        rows = [
            f"    {word}: {_spoken.spoken(' '.join(text.split()))}"
            for word, (_, _, text) in _call.options(name).items()
            if word not in {"help", "out", "no_cache", "spec"} | hidden
        ]
        method.__doc__ = "\n".join([method.__doc__ or "", "", "    Options:", "", *rows, ""])


_document()
