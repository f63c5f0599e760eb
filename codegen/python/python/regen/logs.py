"""Logs: files, columns in memory, and recordings of a simulation."""

from __future__ import annotations

import csv
import io
import json
import os
import pathlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import plots
from .errors import InputError

#: Paths, an experiment as a dict, columns by name, a DataFrame, a :class:`Log`, or a list of these.
Logs = Union[str, "os.PathLike[str]", Mapping[str, Any], Sequence[Any], Any]

#: The keys that show that a dict is an experiment file rather than columns.
_EXPERIMENT = {"runs", "process", "columns"}


def numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Real numbers in double precision; an error for complex numbers, dates and texts."""
    try:
        array = np.asarray(values)
        if array.dtype.kind in "fiubO":
            return np.asarray(array, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"`{name}` is not an array of numbers: {error}") from None
    raise InputError(f"`{name}` has entries of type {array.dtype}, real numbers are needed")


class Log(Mapping[str, "NDArray[np.float64]"]):
    """Columns of a log by name, each of shape (N,); ``t`` in s, the others in SI units.

    >>> log = Log({"t": [0.0, 0.1], "q1": [0.0, 0.2], "tau_q1": [1.0, 1.1]})
    >>> len(log["q1"])
    2
    """

    def __init__(self, columns: Mapping[str, ArrayLike], data: Mapping[str, Any] | None = None) -> None:
        self._columns = {str(name): numbers(str(name), v) for name, v in columns.items()}
        lengths = {len(v) for v in self._columns.values() if v.ndim == 1}
        if len(lengths) != 1 or any(v.ndim != 1 for v in self._columns.values()):
            shapes = {name: v.shape for name, v in self._columns.items()}
            raise InputError(f"the columns of a log are equally long vectors, not {shapes}")
        #: The summary of the run, if the log comes from a simulation.
        self.data = dict(data or {})

    @classmethod
    def read(cls, path: str | os.PathLike[str], data: Mapping[str, Any] | None = None) -> Log:
        """Reads a CSV file with one header line; empty cells are NaN."""
        with open(path, encoding="utf-8", newline="") as file:
            names = next(csv.reader([file.readline()]))
            rows = file.read()
        try:
            values = np.loadtxt(io.StringIO(rows), delimiter=",", ndmin=2)
        except ValueError:
            # slower, and reads an empty cell as NaN
            values = np.atleast_2d(np.genfromtxt(io.StringIO(rows), delimiter=","))
        return cls(dict(zip(names, values.T)), data)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        rows = len(next(iter(self._columns.values())))
        return f"<Log of {rows} rows: {', '.join(self._columns)}>"

    def plot(self, *names: str) -> Any:
        """These columns over ``t``, all where none is named: a figure of matplotlib."""
        return plots.columns(self, names or [name for name in self if name != "t"])

    def to_pandas(self) -> Any:
        """A DataFrame of the columns."""
        import pandas as pd

        return pd.DataFrame(self._columns)

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes a CSV file; its numbers read back as the same doubles."""
        rows = np.column_stack(list(self._columns.values()))
        with open(path, "w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerow(self._columns)
            text = io.StringIO()
            np.savetxt(text, rows, fmt="%.17g", delimiter=",")
            file.write(text.getvalue())


class as_files:
    """Provides paths of logs, which the library reads; writes columns in memory to temporary files."""

    def __init__(self, logs: Logs, texts: dict[str, str] | None = None) -> None:
        self._logs = logs
        self._texts = {} if texts is None else texts
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._count = 0

    def __enter__(self) -> as_files:
        self._folder = tempfile.TemporaryDirectory(prefix="regen-")
        try:
            self.paths = self.more(self._logs, self._texts)
        except BaseException:
            self._folder.cleanup()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    @property
    def path(self) -> pathlib.Path:
        """The temporary folder."""
        assert self._folder is not None
        return pathlib.Path(self._folder.name)

    def more(self, logs: Logs, texts: dict[str, str]) -> list[str]:
        """The paths of more logs."""
        if isinstance(logs, (str, os.PathLike)):
            return [os.fspath(logs)]
        if isinstance(logs, Mapping) and _EXPERIMENT & set(logs):
            texts["experiment.yaml"] = json.dumps(logs, default=_plain)
            return ["experiment.yaml"]
        if isinstance(logs, Mapping) or hasattr(logs, "columns"):
            log = logs if isinstance(logs, Log) else Log(_columns(logs))
            self._count += 1
            path = self.path / f"columns{self._count}.csv"
            log.write(path)
            return [str(path)]
        return [path for log in logs for path in self.more(log, texts)]


def _columns(table: Any) -> dict[str, Any]:
    """The columns of a dict or a DataFrame."""
    return {str(name): table[name] for name in table}


def _plain(value: Any) -> Any:
    """Converts numbers of numpy and paths, which JSON does not know."""
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.tolist()
