"""Draws charts: axes with round ticks, a title, a legend, a scale of colours."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.picture.ink import Canvas
from gridslam.report.figures.chart_data import Chart, ColourScale, Curve
from gridslam.report.figures.drawn_shapes import (
    INK,
    PNG_SCALE,
    Area,
    Disc,
    DrawnSheet,
    Raster,
    Shape,
    Stroke,
    TextLine,
    text_width,
)
from gridslam.report.figures.plots import Axis, axis_of, plane_axes

Floats = NDArray[np.float64]

TEXT, TITLE, NOTE = 12, 15, 9  # font sizes, px
LINE_PX = 20  # height of a line of text
MARGIN, TICK_PX = 12, 4
X_TICK_PX, Y_TICK_PX = 90, 35  # approximate distance between ticks
SAMPLE_PX = 26  # length of a sample of a curve in the legend
START_PX = 4.0  # radius of the point at which a curve starts
MAX_LABEL_PX = 330  # largest width of a name in the legend
GRID_COLOUR, GRID_PX = "#d5d9df", 0.7
ROWS_AT_ONCE = 64  # rows of background pixels computed together: they take 100 bytes a pixel
# Widths of the scale of colours, of the gap before it, and of its texts
SCALE_PX, SCALE_GAP_PX, SCALE_TEXT_PX = 14, 14, 60


def draw_charts(charts: Sequence[Chart], width: int, height: int) -> DrawnSheet:
    """A sheet with the charts one below the other.

    `width` is that of the sheet, `height` that of the axes of each chart (px), to which title and legend are added.
    """
    shapes: list[Shape] = []
    top = 0
    left = max(_left_px(chart, width, height) for chart in charts)
    x = np.concatenate([curve.x for chart in charts for curve in chart.curves] or [np.zeros(0)])
    for chart in charts:
        parts, top = _chart(chart, x, (left, width), top, height)
        shapes += parts
    return DrawnSheet(width, top, shapes)


def _left_px(chart: Chart, width: int, height: int) -> float:
    """Smallest pixel at which the x axis of a chart may start: right of the numbers of its y axis."""
    _, y = _axes(chart, np.zeros(0), (MARGIN, width - MARGIN), (height, 0.0))
    return MARGIN + 2 * TICK_PX + _widest(_ticks(y, Y_TICK_PX, chart.is_log))


def _chart(
    chart: Chart, x_values: Floats, sides: tuple[float, int], top: int, height: int
) -> tuple[list[Shape], int]:
    """The shapes of a chart from the pixel `top` on, and the pixel at which it ends.

    `x_values` are those of all charts of the sheet; `sides` are the pixel at which the x axis starts, and the width of the sheet.
    """
    left, width = sides
    shapes: list[Shape] = []
    at = top + MARGIN
    if chart.title:
        shapes.append(TextLine(MARGIN, at + TITLE, chart.title, TITLE))
        at += LINE_PX + TITLE - TEXT
    entries, at = _legend(chart.legend, width, at)
    shapes += entries
    shapes.append(TextLine(MARGIN, at + TEXT, chart.y_label, TEXT))
    upper, lower = at + LINE_PX + TICK_PX, at + LINE_PX + TICK_PX + height
    last = width - MARGIN - TEXT
    if chart.scale is not None:
        last -= SCALE_GAP_PX + SCALE_PX + SCALE_TEXT_PX
    x, y = _axes(chart, x_values, (left, last), (lower, upper))
    if chart.backdrop is not None:
        shapes.append(_raster(chart.backdrop, x, y))
    shapes += _frame(chart, x, y)
    for curve in chart.curves:
        shapes += _marks(curve, x, y)
    for at_x, at_y, text in chart.notes:
        at_px = x.at(np.array([at_x])), y.at(np.array([at_y]))
        shapes.append(TextLine(float(at_px[0][0]) + START_PX, float(at_px[1][0]) - START_PX, text, NOTE))
    if chart.scale is not None:
        shapes += _colour_bar(chart.scale, last + SCALE_GAP_PX, upper, lower)
    return shapes, lower + 2 * LINE_PX + TICK_PX


def _axes(
    chart: Chart, x_values: Floats, x_px: tuple[float, float], y_px: tuple[float, float]
) -> tuple[Axis, Axis]:
    """The axes of a chart between pixels (first, last); the x axis ends with `x_values`, unless these are all the same."""
    y = np.concatenate([curve.y for curve in chart.curves] or [np.zeros(0)])
    if chart.is_plane:
        x = np.concatenate([curve.x for curve in chart.curves] or [np.zeros(0)])
        points = np.concatenate([np.stack([x, y], axis=1), chart.within])
        return plane_axes(points, x_px, y_px)
    across, up = axis_of(x_values, *x_px), axis_of(y, *y_px)
    if len(x_values) and x_values.max() > x_values.min():
        across = Axis(float(x_values.min()), float(x_values.max()), *x_px)
    return across, Axis(0.0, up.high, *y_px) if chart.from_zero else up


def _raster(backdrop: Callable[[Floats], Canvas], x: Axis, y: Axis) -> Raster:
    """The colours behind the curves of a plane, evaluated at the middle of each pixel of the PNG."""
    cols, rows = (round(abs(axis.last - axis.first) * PNG_SCALE) for axis in (x, y))
    step = (x.high - x.low) / (x.last - x.first) / PNG_SCALE
    along, up = x.low + step * (np.arange(cols) + 0.5), y.high - step * (np.arange(rows) + 0.5)
    colours = [
        backdrop(np.stack(np.meshgrid(along, band), axis=-1).reshape(-1, 2)).reshape(-1, cols, 3)
        for band in np.array_split(up, -(-rows // ROWS_AT_ONCE))
    ]
    return Raster(x.first, y.last, np.concatenate(colours))


def _ticks(axis: Axis, spacing_px: float, is_log: bool = False) -> list[tuple[float, str]]:
    """Pixels and texts of round values, with as many digits as their step needs.

    `is_log`: the axis has logarithms to base 10; ticks are at whole ones, and their texts are the powers of 10.
    """
    if is_log:
        powers = np.arange(np.ceil(axis.low), np.floor(axis.high) + 1.0)
        return [(p, f"{10.0**v:g}") for p, v in zip(axis.at(powers).tolist(), powers.tolist(), strict=True)]
    ticks = axis.ticks(max(int(abs(axis.last - axis.first) / spacing_px), 2))
    step = float(ticks[1] - ticks[0]) if len(ticks) > 1 else 1.0
    digits = max(-int(np.floor(np.log10(step) + 1e-9)), 0)
    at = axis.at(ticks).tolist()
    return [(p, f"{value + 0.0:.{digits}f}") for p, value in zip(at, ticks.tolist(), strict=True)]


def _widest(ticks: Sequence[tuple[float, str]]) -> float:
    """The width of the widest number of an axis."""
    return max((text_width(text, TEXT) for _, text in ticks), default=0.0)


def _frame(chart: Chart, x: Axis, y: Axis) -> list[Shape]:
    """Grid lines, numbers and names of both axes."""
    shapes: list[Shape] = []
    below, names = y.first + TICK_PX + LINE_PX - 4, y.first + TICK_PX + 2 * LINE_PX - 6
    for at, text in _ticks(x, max(X_TICK_PX, 1.3 * _widest(_ticks(x, X_TICK_PX)))):
        shapes.append(Stroke(np.array([[at, y.last], [at, y.first]]), GRID_COLOUR, GRID_PX))
        half = 0.5 * text_width(text, TEXT)
        shapes.append(TextLine(min(max(at, half), x.last + TEXT - half), below, text, TEXT, "middle"))
    for at, text in _ticks(y, Y_TICK_PX, chart.is_log):
        shapes.append(Stroke(np.array([[x.first, at], [x.last, at]]), GRID_COLOUR, GRID_PX))
        shapes.append(TextLine(x.first - 2 * TICK_PX, at + 4, text, TEXT, "end"))
    corner = np.array([[x.first, y.last], [x.first, y.first], [x.last, y.first]])
    shapes.append(Stroke(corner, INK, 1.0))
    shapes.append(TextLine(x.last, names, chart.x_label, TEXT, "end"))
    return shapes


def _marks(curve: Curve, x: Axis, y: Axis) -> list[Shape]:
    """The line of a curve and its points."""
    points = np.stack([x.at(curve.x), y.at(curve.y)], axis=1)
    shapes: list[Shape] = []
    if len(points) > 1:
        shapes.append(Stroke(points, curve.colour, curve.width, curve.is_dashed))
    if curve.point_px:
        shapes += [Disc(a, b, curve.point_px, curve.colour) for a, b in points.tolist()]
    if curve.has_start and len(points):
        shapes.append(Disc(float(points[0, 0]), float(points[0, 1]), START_PX, curve.colour))
    return shapes


def _legend(entries: Sequence[Curve], width: int, top: int) -> tuple[list[Shape], int]:
    """Samples of curves with their labels from the pixel `top` on, in as many rows as needed, and the pixel below them."""
    shapes: list[Shape] = []
    at = float(MARGIN)
    for entry in entries:
        label = _shortened(entry.label)
        needed = SAMPLE_PX + TICK_PX + text_width(label, TEXT) + 2 * MARGIN
        if at > MARGIN and at + needed > width:
            at, top = float(MARGIN), top + LINE_PX
        y = top + TEXT - 4
        sample = np.array([[at, y], [at + SAMPLE_PX, y]], np.float64)
        shapes.append(Stroke(sample, entry.colour, 2.0, entry.is_dashed))
        shapes.append(TextLine(at + SAMPLE_PX + TICK_PX, top + TEXT, label, TEXT))
        at += needed
    return shapes, top + LINE_PX if entries else top


def _shortened(label: str) -> str:
    """The label, or its end if it is too long, since names of results differ at their ends."""
    if text_width(label, TEXT) <= MAX_LABEL_PX:
        return label
    low, high = 0, len(label)  # characters to leave out; binary search, as names may be very long
    while low < high:
        middle = (low + high) // 2
        has_room = text_width("..." + label[middle:], TEXT) <= MAX_LABEL_PX
        low, high = (low, middle) if has_room else (middle + 1, high)
    return "..." + label[low:]


def _colour_bar(scale: ColourScale, left: float, upper: float, lower: float) -> list[Shape]:
    """The colours from the lowest value, at the bottom, to the highest value, with numbers beside them."""
    axis = Axis(scale.low, scale.low + scale.span, lower, upper)
    edges = np.linspace(lower, upper, len(scale.colours) + 1).tolist()
    shapes: list[Shape] = [
        Area(left, edges[k + 1], left + SCALE_PX, edges[k], colour) for k, colour in enumerate(scale.colours)
    ]
    for at, text in _ticks(axis, Y_TICK_PX):
        shapes.append(Stroke(np.array([[left + SCALE_PX, at], [left + SCALE_PX + TICK_PX, at]]), INK, 1.0))
        shapes.append(TextLine(left + SCALE_PX + 2 * TICK_PX, at + 4, text, TEXT))
    end = left + SCALE_PX + SCALE_TEXT_PX
    shapes.append(TextLine(end, upper - TICK_PX - 6, scale.label, TEXT, "end"))
    return shapes
