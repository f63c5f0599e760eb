"""The exceptions of the package; each is a :class:`RegenError`."""

from __future__ import annotations

import contextlib
import pathlib
import re
import sys
import warnings
from dataclasses import dataclass
from typing import Iterable, Iterator

from . import _native, _spoken

#: The folders of files whose frames a warning skips, so that it names the caller's line.
_SKIPPED = (str(pathlib.Path(__file__).parent), str(contextlib.__file__))
#: The temporary folder of columns in memory, which their names in messages do without.
_FOLDER = re.compile(r"[^\s`'\"]*[/\\\\]regen-[^/\\\\\s]+[/\\\\](?=columns\d)")


class RegenWarning(UserWarning):
    """A warning about a result: rows that were left out, suspicious columns, short logs."""


def plain(message: str) -> str:
    """A message in the words of Python, with columns in memory named without their temporary folder."""
    return _spoken.spoken(_FOLDER.sub("", message))


def issue(notes: Iterable[str]) -> None:
    """Issues the warnings among the messages of a command, at the line that called the package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_SKIPPED):
        frame, level = frame.f_back, level + 1
    for note in notes:
        if note.startswith("warning: "):
            text = plain(note.removeprefix("warning: "))
            warnings.warn(text, RegenWarning, stacklevel=level)


@dataclass(frozen=True)
class Mistake:
    """A mistake in a file, with its place."""

    #: The file's name.
    file: str
    #: The line, from 1.
    line: int
    #: The column in characters, from 1.
    column: int
    #: The mistake in words, with the enclosing elements of the file.
    message: str
    #: What to write instead; may be empty.
    hint: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.message}"


class RegenError(Exception):
    """An error of regen.

    ``mistakes`` has the mistakes in files, each with line and column; ``printed`` what was found
    before the error, for example the whole result of a fit that is not proven to be the optimum.
    """

    def __init__(self, message: str, mistakes: tuple[Mistake, ...] = (), printed: str = "") -> None:
        super().__init__(message)
        self.mistakes = mistakes
        self.printed = printed

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (str(self), self.mistakes, self.printed)


class DescriptionError(RegenError, ValueError):
    """Mistakes in a description, an experiment file or another file; ``mistakes`` has the places."""


class OptionError(RegenError, TypeError):
    """Options that do not exist, or cannot be combined."""


class InputError(RegenError, ValueError):
    """Other input that is wrong: states, names, logs."""


class NumericError(RegenError, ArithmeticError):
    """A state that cannot be closed or is singular; parameters that the data leave undetermined."""


class CheckError(RegenError):
    """A check failed; ``printed`` has the result."""


class FileError(RegenError, OSError):
    """A file that cannot be read or written."""

    def __str__(self) -> str:
        return str(self.args[0])


_KINDS: dict[str, type[RegenError]] = {
    "check": CheckError,
    "usage": OptionError,
    "description": DescriptionError,
    "input": InputError,
    "numeric": NumericError,
    "io": FileError,
}


@contextlib.contextmanager
def translated() -> Iterator[None]:
    """Converts errors of the native part to those of this module."""
    try:
        yield
    except _native.NativeError as error:
        kind, message, mistakes, printed, notes = error.args
        # what looks wrong may be why it failed
        issue(notes)
        found = tuple(Mistake(*mistake) for mistake in mistakes)
        raise _KINDS.get(kind, RegenError)(plain(message), found, printed) from None
