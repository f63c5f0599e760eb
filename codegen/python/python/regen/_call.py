"""Calls of the command's functions in this process: keywords become options."""

from __future__ import annotations

import difflib
import json
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Any

from . import _native
from .errors import OptionError, issue, translated

#: Receives the name of the current step, the number of parts done, and the number of parts or None.
Progress = Callable[[str, int, "int | None"], object]


@cache
def options(command: str) -> dict[str, tuple[bool, bool, str]]:
    """The options of a command by keyword: takes a value, may be repeated, help."""
    return {
        name.replace("-", "_"): (takes, repeated, text)
        for name, takes, repeated, _, text in _native.options(command)
    }


def _value(value: Any) -> str:
    if isinstance(value, bool):
        raise OptionError(f"{value} is not a value of this option")
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, tuple):
        return ",".join(_value(part) for part in value)
    if isinstance(value, os.PathLike):
        return str(os.fspath(value))
    return str(value)


def _values(value: Any) -> Iterable[str]:
    if isinstance(value, Mapping):
        return [f"{key}={_value(part)}" for key, part in value.items()]
    if isinstance(value, (list, set, frozenset)):
        return [_value(part) for part in value]
    return [_value(value)]


def words(command: str, given: Mapping[str, Any]) -> list[str]:
    """The words of options that are given as keywords.

    True stands for an option without a value, None and False for none; a tuple is joined by commas,
    a list repeats the option, and a dict repeats it with NAME=VALUE.
    """
    known = options(command)
    out: list[str] = []
    for name, value in given.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            raise OptionError(f"{command}() has no option '{name}'{hint}")
        if value is None or value is False:
            continue
        option = "--" + name.replace("_", "-")
        takes_value = known[name][0]
        if not takes_value:
            if value is not True:
                raise OptionError(f"'{name}' is True or False")
            out.append(option)
            continue
        out.extend(f"{option}={text}" for text in _values(value))
    return out


def call(
    command: str,
    positional: Iterable[str],
    given: Mapping[str, Any],
    texts: Mapping[str, str] | None = None,
    progress: Progress | bool | None = None,
) -> str:
    """Runs a command, issues its warnings, and returns what it prints."""
    all_words = [command, *words(command, given)]
    if "format" in options(command) and "format" not in given:
        all_words.append("--format=json")
    all_words.extend(["--", *positional])
    printed, notes = run(all_words, dict(texts or {}), progress)
    issue(notes)
    return printed


def run(
    all_words: list[str], texts: dict[str, str], progress: Progress | bool | None
) -> tuple[str, list[str]]:
    """Runs a command from its words; returns what it prints, and its messages."""
    with translated(), _shown(progress) as shown:
        return _native.call_command(all_words, texts, shown)


def parsed(printed: str) -> Any:
    """The JSON that a command printed."""
    return json.loads(printed)


class _shown:
    """The function that receives the progress: the given one, or one that writes a line."""

    def __init__(self, progress: Progress | bool | None) -> None:
        self.own = progress is True
        self.progress: Progress | None
        if self.own:
            self.progress = self._line
        else:
            self.progress = progress if callable(progress) else None
        self.width = 0

    def _line(self, what: str, done: int, of: int | None) -> None:
        part = f" {done}/{of}" if of else ""
        text = f"{what}{part}".strip()[:78]
        sys.stderr.write("\r" + text.ljust(self.width))
        sys.stderr.flush()
        self.width = len(text)

    def __enter__(self) -> Progress | None:
        return self.progress

    def __exit__(self, *_: object) -> None:
        if self.own and self.width:
            sys.stderr.write("\r" + " " * self.width + "\r")
