"""Factors of logs, which the machines of a fleet send to be merged."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
from collections.abc import Iterable

from . import _native
from .errors import InputError


class Factors:
    """Factors that replace logs in least squares; their size does not depend on the logs' length.

    ``a + b`` merges factors. Any grouping and order gives the same result to the last bit, because
    the parts are stored separately until :meth:`text` merges them in the order of their content.
    Factors are pickled as text, and two are equal if they have the same parts.

    To reduce the factors of a fleet, call ``Factors.merged(parts)``, then
    ``robot.identify(factors)``.
    """

    __slots__ = ("_parts",)

    def __init__(self, parts: Iterable[str]) -> None:
        self._parts = tuple(sorted(parts))
        for part in self._parts:
            if not part.lstrip().startswith("{"):
                raise InputError("the parts of factors must be texts of factor files")

    @classmethod
    def read(cls, *paths: str | os.PathLike[str]) -> Factors:
        """Reads files that `regen observe` or :meth:`write` wrote."""
        return cls(pathlib.Path(path).read_text(encoding="utf-8") for path in paths)

    @classmethod
    def merged(cls, factors: Iterable[Factors]) -> Factors:
        """The parts of all of these factors."""
        return cls(part for one in factors for part in one._parts)

    def __add__(self, other: Factors) -> Factors:
        return Factors(self._parts + other._parts)

    def __len__(self) -> int:
        """The number of parts."""
        return len(self._parts)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Factors) and self._parts == other._parts

    def __hash__(self) -> int:
        return hash(self._parts)

    def __reduce__(self) -> tuple[object, ...]:
        return Factors, (self._parts,)

    def __repr__(self) -> str:
        return f"<Factors: {len(self)} parts, {self.nbytes} bytes>"

    @property
    def nbytes(self) -> int:
        """The size of all parts as text, in bytes: the data that machines have to send."""
        return sum(len(part.encode()) for part in self._parts)

    @property
    def rows(self) -> int:
        """The number of equations."""
        return sum(f["rows"] for part in self._parts for f in json.loads(part)["factors"])

    def text(self) -> str:
        """The text of one factor file, all parts merged."""
        if not self._parts:
            raise InputError("there are no factors to merge")
        try:
            return _native.merge_factors(list(self._parts))
        except ValueError as error:
            raise InputError(str(error)) from None

    def compact(self) -> Factors:
        """All parts merged into one. Later merges then depend on the grouping, up to rounding."""
        return Factors([self.text()])

    def digest(self) -> str:
        """The SHA-256 of :meth:`text`."""
        return hashlib.sha256(self.text().encode()).hexdigest()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes one factor file, for `regen identify --from`."""
        pathlib.Path(path).write_text(self.text(), encoding="utf-8")
