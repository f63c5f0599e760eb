"""Writes python/regen/options.py: the options of the commands as types, from the commands themselves.

    python tools/options.py > python/regen/options.py
"""

from regen import _native
from regen._spoken import spoken

#: Options that the package sets itself.
OWN = {"format", "help", "no-cache", "from", "spec"}
#: Options that write files, kept where the file is more than the result.
OWN_OUT = {"excite", "simulate", "observe", "report", "export", "generate", "view"}
#: Commands whose format is that of the result.
OWN_FORMAT = {"equations"}
#: The command and its class.
COMMANDS = {
    "new": "NewOptions",
    "import": "ImportOptions",
    "excite": "ExciteOptions",
    "simulate": "SimulateOptions",
    "inspect": "InspectOptions",
    "observe": "ObserveOptions",
    "identify": "IdentifyOptions",
    "validate": "ValidateOptions",
    "report": "ReportOptions",
    "rehearse": "RehearseOptions",
    "calibrate": "CalibrateOptions",
    "equations": "EquationsOptions",
    "generate": "GenerateOptions",
}
#: Options that are parameters of the methods.
NAMED = {
    "excite": {"calibrate", "measure"},
    "simulate": {"trajectory", "parameters"},
    "rehearse": {"trajectory", "parameters"},
}

HEAD = '''"""The keywords of the methods, by command. Written by tools/options.py; do not edit.

True stands for an option without a value; a tuple is joined by commas, a list repeats the option,
and a dict repeats it with NAME=VALUE.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict, Union

Value = Union[str, int, float, "os.PathLike[str]", tuple[Any, ...], Mapping[str, Any], Any]
Values = Union[Value, Sequence[Value]]
'''


def main() -> None:
    """Prints the file."""
    print(HEAD)
    parts = []
    for command, name in COMMANDS.items():
        rows = []
        for option, takes, repeated, words, text in sorted(_native.options(command)):
            own = OWN | NAMED.get(command, set()) | ({"out"} if command in OWN_OUT else set())
            if option in own - ({"format"} if command in OWN_FORMAT else set()):
                continue
            kind = ("Values | None" if repeated else "Value | None") if takes else "bool"
            if words and not repeated:
                kind = f"Literal[{', '.join(map(repr, words))}] | None".replace("'", '"')
            rows.append(f"    #: {spoken(' '.join(text.split()))}")
            rows.append(f"    {option.replace('-', '_')}: {kind}")
        parts.append(
            "\n".join([f"class {name}(TypedDict, total=False):", f'    """Of ``{command}``."""', "", *rows])
        )
    print("\n" + "\n\n\n".join(parts))


if __name__ == "__main__":
    main()
