"""A plot of the lengths of runs of equal occupancy in a map, and of the fit (stereo-bayes paper, section 2.3)."""

from __future__ import annotations

import numpy as np

from gridslam.maps.occupancy_correlation import CorrelationFit
from gridslam.report.figures.chart_data import Chart, Curve
from gridslam.report.figures.charts import draw_charts
from gridslam.report.figures.drawn_shapes import png_of

MIN_PROBABILITY = 1e-3  # probability at which the curves end
WIDTH, HEIGHT = 640, 320  # px


def correlation_picture(fit: CorrelationFit, title: str) -> bytes:
    """A PNG: for both states the probability that a run is longer than a distance, measured and fitted."""
    curves = []
    for name, curve, colour in (("occupied", fit.occupied, "#1c2028"), ("free", fit.free, "#1e6ec8")):
        shown = curve.measured >= MIN_PROBABILITY
        distance_m = np.r_[0.0, curve.distance_cells[shown] * fit.resolution_m]
        measured, fitted = (np.log10(np.r_[1.0, p[shown]]) for p in (curve.measured, curve.fitted))
        is_shown = fitted >= np.log10(MIN_PROBABILITY)
        steps = np.repeat(distance_m, 2)[1:], np.repeat(measured, 2)[:-1]
        curves.append(Curve(*steps, colour, name))
        curves.append(Curve(distance_m[is_shown], fitted[is_shown], colour, f"{name}, by r0", is_dashed=True))
    chart = Chart(
        curves,
        "distance (m)",
        "probability of a longer run",
        f"{title}: r0 = {fit.r0:.4f} per cell of {100 * fit.resolution_m:.3g} cm",
        legend=curves,
        is_log=True,
    )
    return png_of(draw_charts([chart], WIDTH, HEIGHT))
