"""Figure 10 of the paper for our own trials: how the particles draw together, with and without the cameras."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tests.benchmarks.ispace_trials import Trial

LABELS = {"onboard": "onboard alone", "paper": "with cameras, the paper's equations", "fused": "with cameras"}
SHOWN_S = 50.0


def draw_spread(curves: Mapping[str, Sequence[Trial]], path: Path) -> None:
    """Median, and half of all trials around it, of the standard deviation of all particles' positions over time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.6), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    times = np.arange(0.0, SHOWN_S, 0.5)
    for config, trials in curves.items():
        spreads = np.array([np.interp(times, t.time_s, t.spread_m) for t in trials])
        low, middle, high = np.quantile(spreads, (0.25, 0.5, 0.75), axis=0)
        (line,) = axes.plot(times, middle, label=LABELS.get(config, config))
        axes.fill_between(times, low, high, color=line.get_color(), alpha=0.2, linewidth=0)
    axes.set(xlabel="time since the start (s)", ylabel="spread of the particles (m)", xlim=(0, SHOWN_S))
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)
