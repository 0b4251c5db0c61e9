"""Plots of report.html as SVG elements: curves over time, and paths in the plane.

They are written by hand: a plotting library would take longer to load than all plots take to draw. Where a plot is as wide as a
phone, its text has the size of the page's text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import evenly_to_the_last

Floats = NDArray[np.float64]

MAX_POINTS = 2000
COLOURS = ("#1e6ec8", "#d9661f", "#2f9e44", "#7048e8")
WIDTH, HEIGHT = 420, 190  # size of a plot over time, px
PLANE_HEIGHT = 320
LEFT, RIGHT, TOP, BOTTOM = 50, 10, 22, 34  # margins around the axes, px
X_TICKS, Y_TICKS = 6, 5  # largest number of ticks of an axis
MIN_SPAN = 1e-9  # smallest span of an axis, relative to its values
SMALLEST = 1e-200  # values below it count as zero: pixels divided by their span are more than a float holds


@dataclass(frozen=True, slots=True)
class Line:
    """A curve: times (s) `(n,)`, values `(n,)` and a legend label (empty: none)."""

    times_s: Floats
    values: Floats
    label: str = ""


@dataclass(frozen=True, slots=True)
class PlanePath:
    """A path in the plane: positions `(n, 2)` in metres, a colour, a legend label, and whether its line is dashed."""

    xy_m: Floats
    colour: str
    label: str
    is_dashed: bool = False


@dataclass(frozen=True, slots=True)
class Axis:
    """A linear axis from `low` to `high`, at the positions `first` to `last` of the picture."""

    low: float
    high: float
    first: float
    last: float

    def at(self, values: Floats) -> Floats:
        """Positions (px) of values, elementwise."""
        return np.asarray(
            self.first + (values - self.low) * ((self.last - self.first) / (self.high - self.low))
        )

    def ticks(self, count: int) -> Floats:
        """At most `count` round values."""
        step = _round_up((self.high - self.low) / count)
        return np.arange(np.ceil(self.low / step - 1e-9), np.floor(self.high / step + 1e-9) + 1) * step


def time_plot(lines: Sequence[Line], y_label: str) -> str:
    """An SVG element that plots curves over time."""
    thinned = [thin_out(line.times_s, line.values) for line in lines]
    x = axis_of(np.concatenate([t for t, _ in thinned]), LEFT, WIDTH - RIGHT)
    y = axis_of(np.concatenate([v for _, v in thinned]), HEIGHT - BOTTOM, TOP)
    parts = _frame(x, y, "time since start (s)", y_label, HEIGHT)
    for (times, values), colour in zip(thinned, COLOURS * len(thinned), strict=False):
        parts.append(_polyline(x.at(times), y.at(values), colour))
    named = [(line.label, colour, False) for line, colour in zip(lines, COLOURS * len(lines), strict=False)]
    parts += _legend([entry for entry in named if entry[0]])
    return _svg(parts, HEIGHT)


def plane_plot(paths: Sequence[PlanePath]) -> str:
    """An SVG element with paths in the x-y plane, with the same scale on both axes."""
    thinned = [path.xy_m[_kept(path.xy_m)] for path in paths]
    points = np.concatenate([xy for xy in thinned if len(xy)] or [np.zeros((1, 2))])
    x, y = plane_axes(points, (LEFT, WIDTH - RIGHT), (PLANE_HEIGHT - BOTTOM, TOP))
    parts = _frame(x, y, "x (m)", "y (m)", PLANE_HEIGHT)
    for path, xy in zip(paths, thinned, strict=True):
        parts.append(_polyline(x.at(xy[:, 0]), y.at(xy[:, 1]), path.colour, path.is_dashed))
    parts += _legend([(path.label, path.colour, path.is_dashed) for path in paths])
    return _svg(parts, PLANE_HEIGHT)


def plane_axes(points: Floats, x_px: tuple[float, float], y_px: tuple[float, float]) -> tuple[Axis, Axis]:
    """Axes with the same scale around points `(n, 2)` in metres, between the pixels `x_px` and `y_px` (first, last)."""
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.zeros(2))
    width, height = x_px[1] - x_px[0], y_px[0] - y_px[1]
    span = float(max((high - low) / np.array([width, height]), default=0.0)) * 1.06
    if not span > SMALLEST:
        span = 1.0 / width
    middle = (low + high) / 2.0
    half_x, half_y = span * width / 2.0, span * height / 2.0
    x = Axis(float(middle[0] - half_x), float(middle[0] + half_x), *x_px)
    y = Axis(float(middle[1] - half_y), float(middle[1] + half_y), *y_px)
    return x, y


def thin_out(times_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """At most `MAX_POINTS` finite points (times, values) `(k,)` of the `(n,)` given.

    They are the minimum and maximum of each interval, so that peaks are kept.
    """
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


def _kept(xy_m: Floats) -> NDArray[np.int64]:
    """Indices of at most MAX_POINTS finite points, evenly spaced, the last one among them."""
    finite = np.flatnonzero(np.isfinite(xy_m).all(axis=1))
    return finite[evenly_to_the_last(len(finite), MAX_POINTS)]


def axis_of(values: Floats, first: float, last: float) -> Axis:
    """The axis of values `(n,)` between the pixels `first` and `last`, padded above and below the values.

    A smallest value of 0 has no padding below it.
    """
    low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
    padding = 0.04 * (high - low)
    if not padding > MIN_SPAN * max(abs(low), abs(high), MIN_SPAN):
        largest = max(abs(low), abs(high))
        padding = 0.5 * largest if largest > SMALLEST else 1.0
    return Axis(0.0 if low == 0.0 else low - padding, high + padding, first, last)


def _round_up(step: float) -> float:
    """The smallest value of 1, 2, 5 or 10 times a power of ten that is at least `step`."""
    power = 10.0 ** np.floor(np.log10(step))
    return float(power * min(n for n in (1, 2, 5, 10) if n * power >= step * (1 - 1e-9)))


def _frame(x: Axis, y: Axis, x_label: str, y_label: str, height: float) -> list[str]:
    """Ticks, grid lines and labels of both axes."""
    parts = []
    for value, at in _with_positions(x, X_TICKS):
        parts.append(f'<path class="grid" d="M{at:.1f} {y.last:.1f}V{y.first:.1f}"/>')
        parts.append(f'<text x="{at:.1f}" y="{y.first + 14:.1f}" text-anchor="middle">{value:.6g}</text>')
    for value, at in _with_positions(y, Y_TICKS):
        parts.append(f'<path class="grid" d="M{x.first:.1f} {at:.1f}H{x.last:.1f}"/>')
        parts.append(f'<text x="{x.first - 5:.1f}" y="{at + 4:.1f}" text-anchor="end">{value:.6g}</text>')
    parts.append(f'<path class="axis" d="M{x.first:.1f} {y.last:.1f}V{y.first:.1f}H{x.last:.1f}"/>')
    parts.append(f'<text x="{x.last:.1f}" y="{height - 5}" text-anchor="end">{escape(x_label)}</text>')
    parts.append(f'<text x="4" y="12">{escape(y_label)}</text>')
    return parts


def _with_positions(axis: Axis, count: int) -> list[tuple[float, float]]:
    ticks = axis.ticks(count)
    return [(value + 0.0, at) for value, at in zip(ticks.tolist(), axis.at(ticks).tolist(), strict=True)]


def _polyline(x: Floats, y: Floats, colour: str, is_dashed: bool = False) -> str:
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))
    dashes = ' stroke-dasharray="5 4"' if is_dashed else ""
    return f'<polyline class="curve" stroke="{colour}"{dashes} points="{points}"/>'


def _legend(entries: Sequence[tuple[str, str, bool]]) -> list[str]:
    """Line samples with their labels, from the right, above the plot."""
    parts, x = [], float(WIDTH - RIGHT)
    for label, colour, is_dashed in reversed(entries):
        x -= 6.6 * len(label)
        dashes = ' stroke-dasharray="5 4"' if is_dashed else ""
        parts.append(f'<text x="{x:.1f}" y="12">{escape(label)}</text>')
        parts.append(f'<path class="curve" stroke="{colour}"{dashes} d="M{x - 22:.1f} 8H{x - 4:.1f}"/>')
        x -= 34.0
    return parts


def _svg(parts: Sequence[str], height: int) -> str:
    body = "\n".join(parts)
    return f'<svg class="plot" viewBox="0 0 {WIDTH} {height}" xmlns="http://www.w3.org/2000/svg">\n{body}\n</svg>'
