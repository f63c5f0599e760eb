"""Factors of logs: what a fleet of machines sends to be merged."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
from collections.abc import Iterable

from . import _native
from .errors import InputError


class Factors:
    """What least squares needs of logs, of a size that does not depend on their length.

    ``a + b`` merges, in any grouping and order with the same result to the last bit: the parts are
    kept apart until :meth:`text` merges them in the order of their content. Factors are pickled as
    text, and two are equal if they have the same parts.

    The reduce of a fleet: ``Factors.merged(parts)``, then ``robot.identify(factors)``.
    """

    __slots__ = ("_parts",)

    def __init__(self, parts: Iterable[str]) -> None:
        self._parts = tuple(sorted(parts))
        for part in self._parts:
            if not part.lstrip().startswith("{"):
                raise InputError("parts of factors are the texts of factor files")

    @classmethod
    def read(cls, *paths: str | os.PathLike[str]) -> Factors:
        """Reads files that `regen observe` or :meth:`write` wrote."""
        return cls(pathlib.Path(path).read_text(encoding="utf-8") for path in paths)

    @classmethod
    def merged(cls, factors: Iterable[Factors]) -> Factors:
        """All of these."""
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
        """The bytes of all parts as text, which is what moves between machines."""
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
        """All parts merged to one. What is merged later is then no longer free of grouping."""
        return Factors([self.text()])

    def digest(self) -> str:
        """The SHA-256 of :meth:`text`."""
        return hashlib.sha256(self.text().encode()).hexdigest()

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes one factor file, for `regen identify --from`."""
        pathlib.Path(path).write_text(self.text(), encoding="utf-8")
