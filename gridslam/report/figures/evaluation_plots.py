"""Plots of an evaluation: trajectories over each other, errors over time and along the path, relative errors over distance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_to_the_last
from gridslam.evaluation.association import Pairs
from gridslam.evaluation.kitti_errors import travel_of
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.report.figures.chart_data import Chart, Curve
from gridslam.report.figures.charts import draw_charts
from gridslam.report.figures.coloured_curves import coloured_curves
from gridslam.report.figures.drawn_shapes import DrawnSheet
from gridslam.report.figures.plots import thin_out

Floats = NDArray[np.float64]
MAX_POINTS = 1000  # largest number of points drawn of a path
TRUTH_COLOUR = "#555555"
COLOURS = ("#1e6ec8", "#d9661f", "#2f9e44", "#c2255c", "#7048e8", "#0b8599", "#a17c00", "#e64980")
LENGTHS = 8  # number of lengths of sub-trajectories in the plot of relative errors
SHORTEST, LONGEST = 0.02, 0.5  # of these lengths, as fractions of the length of the path
WIDTH, PLANE_HEIGHT, ERROR_HEIGHT, RELATIVE_HEIGHT = 760, 520, 170, 230  # px
POINT_PX = 2.5


@dataclass(frozen=True, slots=True)
class EvaluatedTrajectory:
    """Name of a result, and its poses paired with the ground truth after alignment."""

    name: str
    pairs: Pairs


def overlay_drawing(results: Sequence[EvaluatedTrajectory], truth: Floats) -> DrawnSheet:
    """All trajectories in the x-y plane, with the true poses `(n, 3)`."""
    path = _thinned(truth)
    true = Curve(path[:, 0], path[:, 1], TRUTH_COLOUR, "ground truth", width=1.2, is_dashed=True)
    curves = [true]
    for result, colour in zip(results, _colours(len(results)), strict=True):
        path = _thinned(result.pairs.estimate)
        curves.append(Curve(path[:, 0], path[:, 1], colour, result.name, has_start=True))
    chart = Chart(curves, "x (m)", "y (m)", "Trajectories", is_plane=True, legend=curves)
    return draw_charts([chart], WIDTH, PLANE_HEIGHT)


def error_drawing(results: Sequence[EvaluatedTrajectory]) -> DrawnSheet:
    """Position and heading error over time."""
    start_ns = min(int(result.pairs.stamps_ns[0]) for result in results)
    position: list[Curve] = []
    heading: list[Curve] = []
    for result, colour in zip(results, _colours(len(results)), strict=True):
        errors = absolute_errors(result.pairs.estimate, result.pairs.truth)
        times = np.asarray((result.pairs.stamps_ns - start_ns) / 1e9)
        for curves, values in ((position, errors.translation_m), (heading, errors.rotation_deg)):
            curves.append(Curve(*thin_out(times, values), colour, result.name, width=1.0))
    legend = position if len(results) > 1 else ()
    time = "time since start (s)"
    charts = [
        Chart(position, time, "position error (m)", "Error over time", from_zero=True, legend=legend),
        Chart(heading, time, "heading error (deg)", from_zero=True),
    ]
    return draw_charts(charts, WIDTH, ERROR_HEIGHT)


def path_error_drawing(result: EvaluatedTrajectory) -> DrawnSheet:
    """The path, coloured by its position error."""
    keep = evenly_to_the_last(len(result.pairs), MAX_POINTS)
    estimate, truth = result.pairs.estimate[keep], result.pairs.truth[keep]
    errors = absolute_errors(estimate, truth).translation_m
    true = Curve(truth[:, 0], truth[:, 1], TRUTH_COLOUR, "ground truth", width=0.8, is_dashed=True)
    pieces, scale = coloured_curves(estimate[:, :2], errors, "position error (m)")
    title = f"Position error along the path: {result.name}"
    chart = Chart([true, *pieces], "x (m)", "y (m)", title, is_plane=True, scale=scale, legend=[true])
    return draw_charts([chart], WIDTH, PLANE_HEIGHT)


def relative_drawing(results: Sequence[EvaluatedTrajectory]) -> DrawnSheet | None:
    """Relative position error over the length of sub-trajectories: mean (line) and 95th percentile (dashed).

    None if no path is long enough.
    """
    means, curves = [], []
    for result, colour in zip(results, _colours(len(results)), strict=True):
        lengths, mean, high = relative_errors_over_length(result.pairs)
        if len(lengths):
            means.append(Curve(lengths, mean, colour, result.name, point_px=POINT_PX))
            curves.append(Curve(lengths, high, colour, width=1.0, is_dashed=True))
    title = "Relative error over distance: mean, and 95th percentile (dashed)"
    chart = Chart(
        [*curves, *means],
        "length of sub-trajectory (m)",
        "position error (m)",
        title,
        from_zero=True,
        legend=means if len(results) > 1 else (),
    )
    return draw_charts([chart], WIDTH, RELATIVE_HEIGHT) if means else None


def relative_errors_over_length(pairs: Pairs) -> tuple[Floats, Floats, Floats]:
    """Lengths (m), and the mean and 95th percentile of the relative position error (m) over them; `(k,)` each."""
    travel = travel_of(pairs.truth)
    if len(travel) < 3 or not travel[-1] > 0.0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    starts = evenly_to_the_last(len(travel), MAX_POINTS)
    rows = []
    for length in np.geomspace(SHORTEST, LONGEST, LENGTHS) * travel[-1]:
        ends = np.searchsorted(travel, travel[starts] + length)
        inside = ends < len(travel)
        first, last = starts[inside], ends[inside]
        if len(first):
            motion = se2.between(pairs.truth[first], pairs.truth[last])
            error = se2.between(motion, se2.between(pairs.estimate[first], pairs.estimate[last]))
            distance = np.hypot(error[:, 0], error[:, 1])
            rows.append((float(length), float(distance.mean()), float(np.percentile(distance, 95))))
    table = np.array(rows).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _colours(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _thinned(poses: Floats) -> Floats:
    return poses[evenly_to_the_last(len(poses), MAX_POINTS)]
