"""Plots of an evaluation: trajectories over each other, errors over time and along the path, relative errors over distance."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.evaluation.association import Pairs
from gridslam.evaluation.kitti_errors import travel_of
from gridslam.evaluation.pose_errors import absolute_errors
from gridslam.report.plots import thin_out

Floats = NDArray[np.float64]
MAX_POINTS = 1000  # of a path
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
TRUTH_COLOUR = "#555555"
COLOURS = ("#1e6ec8", "#d9661f", "#2f9e44", "#c2255c", "#7048e8", "#0b8599", "#a17c00", "#e64980")
ERROR_LEVELS = 24  # colours of a path
LENGTHS = 8  # lengths of sub-trajectories in the plot of relative errors
SHORTEST, LONGEST = 0.02, 0.5  # of the path
DPI = 100


@dataclass(frozen=True, slots=True)
class EvaluatedTrajectory:
    """Name of a result, and its poses paired with the ground truth after alignment."""

    name: str
    pairs: Pairs


def overlay_figure(results: Sequence[EvaluatedTrajectory], truth: Floats) -> Figure:
    """All trajectories in the x-y plane, with the true poses `(n, 3)`."""
    figure, axes = _plane("Trajectories")
    path = _thinned(truth)
    axes.plot(path[:, 0], path[:, 1], "--", color=TRUTH_COLOUR, lw=1.2, label="ground truth")
    for result, colour in zip(results, _colours(len(results)), strict=True):
        path = _thinned(result.pairs.estimate)
        axes.plot(path[:, 0], path[:, 1], color=colour, lw=1.2, label=result.name)
        axes.plot(*path[0, :2], "o", color=colour, ms=4)
    axes.legend(frameon=False)
    return figure


def error_figure(results: Sequence[EvaluatedTrajectory]) -> Figure:
    """Position and heading error over time."""
    figure = _figure(8.0, 4.6)
    upper, lower = figure.subplots(2, 1, sharex=True)
    start_ns = min(int(result.pairs.stamps_ns[0]) for result in results)
    for result, colour in zip(results, _colours(len(results)), strict=True):
        errors = absolute_errors(result.pairs.estimate, result.pairs.truth)
        times = np.asarray((result.pairs.stamps_ns - start_ns) / 1e9)
        for axes, values in ((upper, errors.translation_m), (lower, errors.rotation_deg)):
            axes.plot(*thin_out(times, values), color=colour, lw=1.0, label=result.name)
    upper.set_title("Error over time")
    upper.set_ylabel("position error (m)")
    lower.set_ylabel("heading error (deg)")
    lower.set_xlabel("time since start (s)")
    if len(results) > 1:
        upper.legend(frameon=False)
    return figure


def path_error_figure(result: EvaluatedTrajectory) -> Figure:
    """The path, coloured by its position error."""
    figure, axes = _plane(f"Position error along the path: {result.name}")
    keep = _kept(len(result.pairs))
    pairs = Pairs(result.pairs.stamps_ns[keep], result.pairs.estimate[keep], result.pairs.truth[keep])
    errors = absolute_errors(pairs.estimate, pairs.truth).translation_m
    axes.plot(pairs.truth[:, 0], pairs.truth[:, 1], "--", color=TRUTH_COLOUR, lw=0.8)
    pieces, levels = _pieces_of_equal_error(pairs.estimate[:, :2], errors)
    lines = LineCollection(pieces, cmap="viridis", lw=2.5, capstyle="round")
    lines.set_array(levels)
    axes.add_collection(lines)
    axes.autoscale_view()
    figure.colorbar(lines, ax=axes, label="position error (m)")
    return figure


def _pieces_of_equal_error(points: Floats, errors: Floats) -> tuple[list[Floats], Floats]:
    """The path as polylines of nearly equal error, and their errors: far fewer than one line for each step."""
    low, high = float(errors.min()), float(errors.max())
    width = max(high - low, 1e-12) / ERROR_LEVELS
    level = np.minimum(((errors[:-1] - low) / width).astype(np.int64), ERROR_LEVELS - 1)
    if not len(level):  # one pose has no path
        return [], np.zeros(0)
    starts = np.flatnonzero(np.r_[True, level[1:] != level[:-1]])
    ends = np.r_[starts[1:], len(level)]
    pieces = [points[first : last + 1] for first, last in zip(starts, ends, strict=True)]
    return pieces, low + width * (level[starts] + 0.5)


def relative_figure(results: Sequence[EvaluatedTrajectory]) -> Figure | None:
    """Relative position error over the length of sub-trajectories: mean (line) and 95th percentile (dashed).

    None if no path is long enough.
    """
    figure = _figure(8.0, 3.0)
    axes = figure.add_subplot()
    is_empty = True
    for result, colour in zip(results, _colours(len(results)), strict=True):
        lengths, mean, high = relative_errors_over_length(result.pairs)
        if len(lengths):
            is_empty = False
            axes.plot(lengths, mean, "o-", color=colour, lw=1.2, ms=4, label=result.name)
            axes.plot(lengths, high, "--", color=colour, lw=0.8)
    axes.set_title("Relative error over distance: mean, and 95th percentile (dashed)")
    axes.set_xlabel("length of sub-trajectory (m)")
    axes.set_ylabel("position error (m)")
    axes.set_ylim(bottom=0.0)
    if len(results) > 1:
        axes.legend(frameon=False)
    return None if is_empty else figure


def relative_errors_over_length(pairs: Pairs) -> tuple[Floats, Floats, Floats]:
    """Lengths (m), and the mean and 95th percentile of the relative position error (m) of sub-trajectories that long."""
    travel = travel_of(pairs.truth)
    if len(travel) < 3 or not travel[-1] > 0.0:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    starts = _kept(len(travel))
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


def files_of(figure: Figure) -> tuple[bytes, str]:
    """A figure as PNG and as an SVG element."""
    with mpl.rc_context(STYLE):
        picture, text = io.BytesIO(), io.StringIO()
        figure.savefig(picture, format="png", dpi=DPI, metadata={"Software": None})

        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": None})
    svg = text.getvalue()
    return picture.getvalue(), svg[svg.index("<svg") :]


def _figure(width_in: float, height_in: float) -> Figure:
    """A figure with margins for labels; a layout engine would take as long as drawing."""
    figure = Figure(figsize=(width_in, height_in))
    labels_in = {"left": 0.75, "right": 0.25, "bottom": 0.5, "top": 0.35}
    figure.subplots_adjust(
        left=labels_in["left"] / width_in,
        right=1.0 - labels_in["right"] / width_in,
        bottom=labels_in["bottom"] / height_in,
        top=1.0 - labels_in["top"] / height_in,
    )
    return figure


def _plane(title: str) -> tuple[Figure, Any]:
    figure = _figure(7.0, 5.6)
    axes = figure.add_subplot()
    axes.set_title(title)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    return figure, axes


def _colours(count: int) -> list[str]:
    return [COLOURS[i % len(COLOURS)] for i in range(count)]


def _kept(count: int) -> NDArray[np.int64]:
    """Indices of at most MAX_POINTS of `count` poses, evenly spaced, the last one among them."""
    return np.unique(np.linspace(0, count - 1, min(count, MAX_POINTS)).astype(np.int64))


def _thinned(poses: Floats) -> Floats:
    return poses[_kept(len(poses))]
