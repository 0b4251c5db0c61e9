"""Figure 10 of the paper for our own trials: standard deviation of the particles over time, with and without cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.ispace_trials import LocalizationTrial

LABELS = {"onboard": "onboard alone", "paper": "with cameras, the paper's equations", "fused": "with cameras"}
SHOWN_S = 50.0

Floats = NDArray[np.float64]


def draw_std(trials: Mapping[str, Sequence[LocalizationTrial]], path: Path) -> None:
    """The curves of trials by config."""
    curves = {LABELS.get(name, name): [(t.time_s, t.std_m) for t in found] for name, found in trials.items()}
    draw_curves(curves, path, SHOWN_S)


def draw_curves(curves: Mapping[str, Sequence[tuple[Floats, Floats]]], path: Path, shown_s: float) -> None:
    """Median, and half of all trials around it, of the standard deviation (m) of all particles' positions over time (s)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    times = np.arange(0.0, shown_s, 0.5)
    for label, found in curves.items():
        stds = np.array([np.interp(times, *curve) for curve in found])
        low, middle, high = np.quantile(stds, (0.25, 0.5, 0.75), axis=0)
        (line,) = axes.plot(times, middle, label=label)
        axes.fill_between(times, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set(
        xlabel="time since the start (s)", ylabel="standard deviation of the particles (m)", xlim=(0, shown_s)
    )
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
