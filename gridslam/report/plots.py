"""SVG plots for report.html."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

MAX_POINTS = 2000
COLOUR = "#1e6ec8"
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text is kept as text: small and searchable
    "svg.hashsalt": "gridslam",  # reproducible ids
    "font.family": "sans-serif",
    "font.size": 9.0,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


@dataclass(frozen=True, slots=True)
class Line:
    """A curve: times (s) `(n,)`, values `(n,)` and a legend label (empty: none)."""

    times_s: NDArray[np.float64]
    values: NDArray[np.float64]
    label: str = ""


def time_plot(lines: Sequence[Line], y_label: str) -> str:
    """An SVG element that plots curves over time."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 2.4), layout="constrained")
        axes = figure.add_subplot()
        for index, line in enumerate(lines):
            times, values = thin_out(line.times_s, line.values)
            axes.plot(times, values, lw=1.0, color=COLOUR if index == 0 else None, label=line.label or None)
        axes.set_xlabel("time since start (s)")
        axes.set_ylabel(y_label)
        if any(line.label for line in lines):
            axes.legend(frameon=False)
        return _svg(figure)


def thin_out(
    times_s: NDArray[np.float64], values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """At most MAX_POINTS finite points: minimum and maximum of each interval, so that peaks are kept."""
    finite = np.isfinite(values) & np.isfinite(times_s)
    times, present = times_s[finite], values[finite]
    if len(times) <= MAX_POINTS:
        return times, present
    edges = np.linspace(0, len(times), MAX_POINTS // 2 + 1).astype(int)
    picks = [
        index
        for first, last in pairwise(edges)
        for index in sorted(
            (first + int(present[first:last].argmin()), first + int(present[first:last].argmax()))
        )
    ]
    return times[picks], present[picks]


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    return svg[svg.index("<svg") :]
