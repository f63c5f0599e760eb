"""The results of a robot's functions."""

from __future__ import annotations

import html
import json
import os
import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _call, plots
from .logs import Log

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ._call import Progress


class Result:
    """A result; ``data`` is all of it, as in the JSON that the command prints."""

    def __init__(self, data: dict[str, Any]) -> None:
        #: All of the result.
        self.data = data

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes ``data`` as a JSON file."""
        text = json.dumps(self.data) + "\n"
        pathlib.Path(path).write_text(text, encoding="utf-8")

    #: The column that names the rows of the table.
    _index = "label"

    def _rows(self) -> list[dict[str, Any]]:
        """The rows of the table, as the class says."""
        rows: list[dict[str, Any]] = self.data["parameters"]
        return rows

    def to_pandas(self) -> Any:
        """The table of the result as a DataFrame; a name that repeats itself stays a column."""
        import pandas as pd

        frame = pd.DataFrame(self._rows())
        named = self._index in frame and frame[self._index].is_unique
        return frame.set_index(self._index) if named else frame


def _table(rows: list[dict[str, Any]], index: str) -> Any:
    """A DataFrame if pandas is installed, else the rows."""
    try:
        import pandas as pd
    except ImportError:
        return rows
    frame = pd.DataFrame(rows)
    return frame.set_index(index) if index in frame else frame


def _html(rows: list[dict[str, Any]]) -> str:
    """Rows as an HTML table."""
    if not rows:
        return "<p>nothing</p>"
    names = list(dict.fromkeys(name for row in rows for name in row))

    def shown(value: Any) -> str:
        if isinstance(value, float):
            return f"{value:.6g}"
        return "" if value is None else html.escape(str(value))

    head = "".join(f"<th>{html.escape(name)}</th>" for name in names)
    body = "".join(
        "<tr>" + "".join(f"<td>{shown(row.get(name))}</td>" for name in names) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Identified(Result):
    """Identified parameters; ``to_pandas()`` has a row for each base parameter."""

    @property
    def method(self) -> str:
        """The estimator."""
        return str(self.data["method"])

    @property
    def labels(self) -> list[str]:
        """The labels of the base parameters."""
        return [row["label"] for row in self.data["parameters"]]

    def _column(self, name: str) -> NDArray[np.float64]:
        values = [row[name] for row in self.data["parameters"]]
        return np.array([np.nan if v is None else v for v in values], dtype=float)

    @property
    def values(self) -> NDArray[np.float64]:
        """The base parameters, SI; shape (rank,): ``beta`` of the functions of a robot."""
        return self._column("value")

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Their standard deviations, SI; shape (rank,)."""
        return self._column("sigma")

    @property
    def intervals(self) -> NDArray[np.float64]:
        """Their confidence intervals, SI; shape (rank, 2)."""
        return np.column_stack([self._column("low"), self._column("high")])

    @property
    def phi(self) -> NDArray[np.float64] | None:
        """All parameters of a physical model (``feasible=True``), SI; None without such a model."""
        rows = self.data.get("physical") or []
        return np.array([row["value"] for row in rows]) if rows else None

    @property
    def table(self) -> Any:
        """The base parameters as a table: a DataFrame if pandas is installed."""
        return _table(self.data["parameters"], "label")

    @property
    def physical(self) -> Any:
        """All parameters of a physical model as a table."""
        return _table(self.data.get("physical") or [], "label")

    def plot(self) -> Any:
        """The parameters with their intervals, in percent of the values: a figure of matplotlib."""
        return plots.parameters(self)

    def __repr__(self) -> str:
        return f"<Identified {self.data['robot']}: {len(self.labels)} base parameters, {self.method}>"

    def _repr_html_(self) -> str:
        names = ("label", "unit", "value", "sigma", "sigma_percent", "low", "high", "status")
        rows = [{n: row.get(n) for n in names} for row in self.data["parameters"]]
        return f"<p>{html.escape(repr(self)[1:-1])}</p>" + _html(rows)


class Calibration(Result):
    """The geometry that fits measurements, and what they cannot tell; ``to_pandas()``: its numbers."""

    @property
    def values(self) -> dict[str, float]:
        """The numbers that were found, by name, rad or m; of simulated poses the true ones."""
        rows = self.data["estimates"]
        return {row["name"]: row["value"] for row in rows if row["value"] is not None}

    @property
    def table(self) -> Any:
        """Each number with its nominal value, deviation and interval: a DataFrame with pandas."""
        return _table(self._rows(), self._index)

    _index = "name"

    def _rows(self) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = self.data["estimates"]
        return rows

    @property
    def doubts(self) -> list[str]:
        """What is wrong with the measurements, in words."""
        return list(self.data["doubts"])

    def __repr__(self) -> str:
        count = len(self.data["estimates"])
        return f"<Calibration of {self.data['robot']}: {count} numbers from {self.data['poses']} poses>"


class Rehearsal(Result):
    """How often simulated logs would give the true parameters; ``to_pandas()`` has a row for each."""

    @property
    def score(self) -> float:
        """The percentage of seeds within 3 sigma of the truth, for the parameter where it is lowest."""
        least = self.data["least"]
        return float("nan") if least is None else float(least)

    @property
    def passed(self) -> bool:
        """Whether the score reaches the option ``score``, 90 % where it is not given."""
        return bool(self.data["passed"])

    @property
    def table(self) -> Any:
        """Truth, mean estimate, errors and intervals of each parameter: a DataFrame with pandas."""
        return _table(self.data["parameters"], "label")

    def __repr__(self) -> str:
        verdict = "passed" if self.passed else "not passed"
        return f"<Rehearsal of {self.data['robot']}: score {self.score:.1f} %, {verdict}>"

    def _repr_html_(self) -> str:
        names = ("label", "truth", "mean", "rms_percent", "sigma_percent", "bias", "within", "inside")
        rows = [{n: row.get(n) for n in names} for row in self.data["parameters"]]
        return f"<p>{html.escape(repr(self)[1:-1])}</p>" + _html(rows)


class Validation(Result):
    """The errors of predicted efforts; ``to_pandas()`` has a row for each effort of each log."""

    def __init__(self, data: dict[str, Any], predictions: Log) -> None:
        super().__init__(data)
        #: Measured and predicted efforts as they are compared, N m or N: columns ``t`` in s,
        #: ``tau_NAME`` and ``predicted_NAME`` of each independent coordinate, with several logs
        #: ``run`` from 1, NaN where an equation is not used; ``predicted2_NAME`` with ``beside``.
        self.predictions = predictions

    def plot(self) -> Any:
        """Measured and predicted efforts over time, a row for each effort: a figure of matplotlib."""
        return plots.efforts(self.predictions)

    @property
    def relative_absolute(self) -> NDArray[np.float64]:
        """eps_RA of each log, percent; shape (logs,)."""
        return np.array(
            [np.nan if log["relative_absolute"] is None else log["relative_absolute"]
             for log in self.data["models"][0]["logs"]],
            dtype=float,
        )

    def _rows(self) -> list[dict[str, Any]]:
        return [
            {"log": name, **effort}
            for model in self.data["models"]
            for name, log in zip(self.data["logs"], model["logs"])
            for effort in log["efforts"]
        ]

    @property
    def table(self) -> Any:
        """The errors of each effort on each log."""
        return _table(self._rows(), "log")

    def __repr__(self) -> str:
        errors = ", ".join(f"{e:.3f} %" for e in self.relative_absolute)
        return f"<Validation of {self.data['robot']}: eps_RA {errors}>"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self)[1:-1])}</p>" + _html(self._rows())


class Excitation(Result):
    """An exciting trajectory for `simulate` and `identify(reference=)`; ``to_pandas()``: its limits."""

    def __init__(self, found: dict[str, Any]) -> None:
        super().__init__(found["trajectory"])
        #: The limits with what is left of them, as a part of half their range.
        self.limits: list[dict[str, Any]] = found["limits"]
        #: The rest of the result: seed, start.
        self.search = {k: v for k, v in found.items() if k not in ("trajectory", "limits")}

    def __repr__(self) -> str:
        return f"<Excitation: {', '.join(self.data)}>"

    def _repr_html_(self) -> str:
        return _html(self.limits)

    def _rows(self) -> list[dict[str, Any]]:
        return self.limits


class Inspection(Result):
    """The contents of logs, and the parameters that the logs can identify; ``to_pandas()``: columns."""

    @property
    def proposal(self) -> str | None:
        """A proposed experiment file, as YAML."""
        text: str | None = self.data["proposal"]
        return text

    def _rows(self) -> list[dict[str, Any]]:
        columns = (
            {"log": log["log"], "column": column["name"], **column}
            for log in self.data["logs"]
            for column in log["columns"]
        )
        plain = (str, int, float, type(None))
        return [
            {key: value for key, value in column.items() if key != "name" and isinstance(value, plain)}
            for column in columns
        ]

    _index = "column"

    def __repr__(self) -> str:
        return f"<Inspection of {len(self.data['logs'])} logs>"


class Explanation:
    """A mechanism in words."""

    def __init__(self, path: str, text: str, progress: Progress | bool | None) -> None:
        self._path, self._text = path, text
        printed = _call.call("check", [path], {}, {path: text}, progress)
        #: All of the explanation, as the JSON that the command prints.
        self.data: dict[str, Any] = _call.parsed(printed)

    def __str__(self) -> str:
        return _call.run(["check", "--", self._path], {self._path: self._text}, None)[0]

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


class Page:
    """A page; ``html`` is its text, which needs no network."""

    def __init__(self, text: str) -> None:
        #: The text of the page.
        self.html = text

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the page."""
        pathlib.Path(path).write_text(self.html, encoding="utf-8")

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self.html)} characters>"

    def _repr_html_(self) -> str:
        page = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{page}" style="width:100%;height:40em;border:0"></iframe>'


class Report(Page):
    """The page of an identification."""
