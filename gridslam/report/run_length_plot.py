"""A plot of the lengths of runs of equal occupancy in a map, and of the fit (stereo-bayes paper, section 2.3)."""

from __future__ import annotations

import io

import numpy as np

from gridslam.maps.occupancy_correlation import CorrelationFit

MIN_PROBABILITY = 1e-3  # at which the curves end


def correlation_picture(fit: CorrelationFit, title: str) -> bytes:
    """A PNG: for both states the probability that a run is longer than a distance, measured and fitted."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), dpi=90, layout="constrained")
    axes = figure.add_subplot()
    for name, curve, colour in (("occupied", fit.occupied, "#1c2028"), ("free", fit.free, "#1e6ec8")):
        shown = curve.measured >= MIN_PROBABILITY
        distance_m = np.r_[0.0, curve.distance_cells[shown] * fit.resolution_m]
        axes.step(distance_m, np.r_[1.0, curve.measured[shown]], where="post", color=colour, label=name)
        axes.plot(distance_m, np.r_[1.0, curve.fitted[shown]], "--", color=colour, label=f"{name}, by r0")
    axes.set(
        xlabel="distance (m)",
        ylabel="probability of a longer run",
        yscale="log",
        ylim=(MIN_PROBABILITY, 1.05),
    )
    axes.set_title(f"{title}: r0 = {fit.r0:.4f} per cell of {100 * fit.resolution_m:.3g} cm", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
