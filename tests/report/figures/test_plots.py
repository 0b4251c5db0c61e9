from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.report.figures.plots import MAX_POINTS, Line, PlanePath, plane_plot, thin_out, time_plot


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(0),
        np.array([3.0]),
        np.zeros(10),
        np.full(10, np.nan),
        np.array([1e300, -1e300]),
        np.array([0.0, np.inf, -np.inf, 1.0]),
        np.array([1e-300, 2e-300]),
        np.array([5e-324, 1e-310]),
    ],
    ids=lambda values: str(values[:2]),
)
def test_any_values_give_a_plot_without_a_warning(values: NDArray[np.float64]) -> None:
    svg = time_plot([Line(np.arange(len(values), dtype=float), values)], "m & <unit>")
    assert ET.fromstring(svg).tag.endswith("svg")


def test_positions_next_to_nothing_apart_give_a_plot_without_a_warning() -> None:
    svg = plane_plot([PlanePath(np.array([[0.0, 0.0], [1e-310, 5e-324]]), "#000000", "path")])
    assert ET.fromstring(svg).tag.endswith("svg")


def test_the_same_values_give_the_same_plot() -> None:
    line = Line(np.arange(5.0), np.arange(5.0), "name")
    assert time_plot([line], "m") == time_plot([line], "m")


def test_thinning_keeps_the_peaks_and_the_order() -> None:
    values = np.zeros(100_000)
    values[54_321] = 7.0
    values[99_999] = -2.0
    times, kept = thin_out(np.arange(100_000.0), values)
    assert len(kept) <= MAX_POINTS
    assert (kept.max(), kept.min()) == (7.0, -2.0)
    assert (np.diff(times) >= 0).all()
