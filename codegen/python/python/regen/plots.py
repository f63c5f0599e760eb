"""Figures of results. They need matplotlib, which is imported when the first is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import InputError

if TYPE_CHECKING:
    from .logs import Log
    from .results import Identified


def _rows(count: int, height: float, **options: Any) -> tuple[Any, list[Any]]:
    """A figure with one row of axes each."""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise InputError("plots need matplotlib: pip install matplotlib") from None
    # without pyplot, which would keep every figure until it is closed
    figure = Figure(figsize=(8.0, height * count + 0.6), layout="constrained")
    axes = figure.subplots(count, 1, squeeze=False, **options)
    return figure, list(axes[:, 0])


def parameters(found: Identified) -> Any:
    """The base parameters with their intervals, in percent of the values."""
    unit = np.where(found.values == 0, np.nan, abs(found.values))
    low, high = (100 * abs(side - found.values) / unit for side in found.intervals.T)
    place = np.arange(len(found.labels))
    figure, (axes,) = _rows(1, 0.22 * len(place) + 0.8)
    axes.errorbar(np.zeros(len(place)), place, xerr=[low, high], fmt="o", ms=3, capsize=2)
    axes.set_yticks(place, [f"{label}  {v:.4g}" for label, v in zip(found.labels, found.values)])
    axes.invert_yaxis()
    # parameters that are hardly determined would leave no room for the others
    finite = np.concatenate([low[np.isfinite(low)], high[np.isfinite(high)], [1.0]])
    reach = 1.1 * min(finite.max(), 10 * np.median(finite))
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("interval, percent of the value")
    axes.set_title(f"{found.data['robot']}: {found.method}")
    axes.grid(alpha=0.3)
    return figure


def efforts(predictions: Log) -> Any:
    """Measured and predicted efforts, a row for each."""
    names = [n.removeprefix("predicted_") for n in predictions if n.startswith("predicted_")]
    figure, all_axes = _rows(len(names), 2.0, sharex=True)
    runs = predictions["run"] if "run" in predictions else np.ones(len(predictions["t"]))
    # runs follow each other
    time, end = np.array(predictions["t"]), 0.0
    for run in np.unique(runs):
        own = runs == run
        time[own] += end - time[own][0]
        end = time[own][-1]
    for axes, name in zip(all_axes, names):
        measured, predicted = predictions[f"tau_{name}"], predictions[f"predicted_{name}"]
        axes.plot(time, measured, lw=1.0, label="measured")
        axes.plot(time, predicted, lw=1.0, label="predicted")
        axes.plot(time, measured - predicted, lw=0.7, color="0.5", label="difference")
        axes.set_ylabel(f"{name}, N m or N")
        axes.grid(alpha=0.3)
    all_axes[0].legend(loc="upper right", ncols=3, fontsize="small")
    all_axes[-1].set_xlabel("time from the start of the first run, s")
    return figure


def columns(log: Log, names: Sequence[str]) -> Any:
    """Columns of a log over time, a row for each."""
    figure, all_axes = _rows(len(names), 1.4, sharex=True)
    for axes, name in zip(all_axes, names):
        if name not in log:
            raise InputError(f"the log has no column '{name}'; it has {', '.join(log)}")
        axes.plot(log["t"], log[name], lw=1.0)
        axes.set_ylabel(name)
        axes.grid(alpha=0.3)
    all_axes[-1].set_xlabel("t, s")
    return figure
