"""Frame of a map picture: axes in metres, grid, origin, scale bar, legend, title."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from gridslam.maps.picture import ink
from gridslam.maps.picture.ink import Canvas, Colour
from gridslam.maps.picture.window import MapWindow

# Height of the text to the width of the sheet: legible where a phone shows the sheet on its width
TEXT_RATIO = 1 / 44
MIN_TEXT_PX, MAX_TEXT_PX = 14, 44
TICK_TEXTS = 5.0  # smallest distance of ticks, in text heights
ROWS_AT_ONCE = 256  # that are copied to a sheet: Pillow's copy of all would take more memory than the canvas
GRID: Colour = (150, 160, 172)
GRID_OPACITY = 0.55

Mark = Literal["area", "line", "dot", "axes"]


@dataclass(frozen=True, slots=True)
class LegendEntry:
    """A mark of the legend and its text."""

    mark: Mark
    colour: Colour
    text: str


def text_size(width_px: int) -> int:
    """Height of the text on a picture of this width."""
    return int(min(max(round(width_px * TEXT_RATIO), MIN_TEXT_PX), MAX_TEXT_PX))


def tick_step_m(px_per_m: float, text_px: int) -> float:
    """Distance of ticks: 1, 2 or 5 times a power of ten."""
    min_step_m = TICK_TEXTS * text_px / px_per_m
    power = 10.0 ** np.floor(np.log10(min_step_m))
    return float(power * min(step for step in (1, 2, 5, 10) if step * power >= min_step_m * (1 - 1e-9)))


def draw_grid(canvas: Canvas, window: MapWindow, step_m: float) -> None:
    """Lines at the ticks of both axes."""
    width, height = window.size_px

    def draw(target: Canvas) -> None:
        for at, _ in _ticks(window, "x", step_m):
            ink.line(target, np.array([[at, 0.0], [at, height]]), GRID, 1.0)
        for at, _ in _ticks(window, "y", step_m):
            ink.line(target, np.array([[0.0, at], [width, at]]), GRID, 1.0)

    ink.translucent(canvas, GRID_OPACITY, draw)


def draw_origin(canvas: Canvas, window: MapWindow, length_px: float, width_px: float) -> bool:
    """The axes of the map frame at its origin, x red and y green; whether the origin lies in the window."""
    length_m = length_px / window.px_per_m
    origin, x_end, y_end = window.pixels(np.array([[0.0, 0.0], [length_m, 0.0], [0.0, length_m]]))
    width, height = window.size_px
    if not (0.0 <= origin[0] <= width and 0.0 <= origin[1] <= height):
        return False
    for end, colour in ((x_end, ink.AXIS_X), (y_end, ink.AXIS_Y)):
        _arrow(canvas, origin, end, colour, width_px)
    return True


def _arrow(canvas: Canvas, origin: ink.Pixels, end: ink.Pixels, colour: Colour, width_px: float) -> None:
    along = (end - origin) / max(float(np.hypot(*(end - origin))), 1e-9)
    aside, head = np.array([-along[1], along[0]]), 3.0 * width_px
    ink.line(canvas, np.stack([origin, end - along * head]), ink.PAPER, width_px + 3.0)
    ink.line(canvas, np.stack([origin, end - along * head]), colour, width_px)
    ink.polygon(
        canvas,
        np.stack(
            [end + along, end - along * head + aside * head * 0.6, end - along * head - aside * head * 0.6]
        ),
        colour,
    )


def with_axes(canvas: Canvas, window: MapWindow, step_m: float, text_px: int) -> Image.Image:
    """A window with a frame, and ticks in metres below it and on its left."""
    font = _font(text_px)
    width, height = window.size_px
    # Texts need less space above each other.
    y_step_m = min(step_m, tick_step_m(window.px_per_m, round(0.5 * text_px)))
    ticks = {"x": _ticks(window, "x", step_m), "y": _ticks(window, "y", y_step_m)}
    names = _axis_names(window)
    labels_px = max((font.getlength(text) for _, text in ticks["y"]), default=0.0)
    left = round(max(labels_px, font.getlength(names[1])) + 0.8 * text_px)
    below, above, right = round(1.7 * text_px), round(0.7 * text_px), round(1.2 * text_px)
    sheet = Image.new("RGB", (left + width + right, above + height + below), ink.PAPER)
    for first in range(0, height, ROWS_AT_ONCE):
        sheet.paste(Image.fromarray(canvas[first : first + ROWS_AT_ONCE]), (left, above + first))
    draw = ImageDraw.Draw(sheet)
    draw.rectangle((left - 1, above - 1, left + width, above + height), outline=ink.INK)
    tick, end = round(0.3 * text_px), font.getlength(names[0])
    for at, text in ticks["x"]:
        draw.line((left + at, above + height, left + at, above + height + tick), fill=ink.INK)
        if at + font.getlength(text) / 2 < width - end - 0.3 * text_px:
            draw.text((left + at, above + height + tick), text, fill=ink.INK, font=font, anchor="ma")
    for at, text in ticks["y"]:
        draw.line((left - tick, above + at, left, above + at), fill=ink.INK)
        if at > 1.6 * text_px:
            draw.text((left - tick - 3, above + at), text, fill=ink.INK, font=font, anchor="rm")
    draw.text((left + width, above + height + tick), names[0], fill=ink.INK, font=font, anchor="ra")
    draw.text((left - tick - 3, above), names[1], fill=ink.INK, font=font, anchor="ra")
    return sheet


def _axis_names(window: MapWindow) -> tuple[str, str]:
    """Names of the axes; those of a turned grid are not the map's."""
    if not window.geometry.yaw_rad:
        return "x (m)", "y (m)"
    return f"x turned by {np.degrees(window.geometry.yaw_rad):.4g} deg (m)", "y (m)"


def _ticks(window: MapWindow, axis: str, step_m: float) -> list[tuple[float, str]]:
    """Positions (px) and texts of the ticks of an axis."""
    first, last = window.limits_m()[0 if axis == "x" else 1]
    values = np.arange(np.ceil(first / step_m), np.floor(last / step_m) + 1) * step_m
    along = (values - first) if axis == "x" else (last - values)
    digits = max(-int(np.floor(np.log10(step_m))), 0)
    return [
        (float(at * window.px_per_m), f"{value + 0.0:.{digits}f}")
        for at, value in zip(along, values, strict=True)
    ]


def joined(pieces: Sequence[Image.Image], side_by_side: bool) -> Image.Image:
    """Pieces below each other, or side by side, aligned at their right and lower edges."""
    if len(pieces) == 1:
        return pieces[0]
    if side_by_side:
        size = sum(p.width for p in pieces), max(p.height for p in pieces)
    else:
        size = max(p.width for p in pieces), sum(p.height for p in pieces)
    sheet = Image.new("RGB", size, ink.PAPER)
    x = y = 0
    for piece in pieces:
        if side_by_side:
            sheet.paste(piece, (x, size[1] - piece.height))
            x += piece.width
        else:
            sheet.paste(piece, (size[0] - piece.width, y))
            y += piece.height
    return sheet


def framed(
    picture: Image.Image,
    scale: tuple[float, str],
    legend: Sequence[LegendEntry],
    title: str | None,
    text_px: int,
) -> Image.Image:
    """The picture with a title above it; below it the scale bar and the legend. `scale` is pixels a metre, and the cell size."""
    font, gap = _font(text_px), round(0.6 * text_px)
    px_per_m, cell = scale
    length_m = _round_length(0.25 * picture.width / px_per_m)
    bar_px = length_m * px_per_m
    first = (
        gap
        + bar_px
        + 0.4 * text_px
        + font.getlength(f"{length_m:g} m")
        + 1.5 * text_px
        + font.getlength(cell)
        + 1.5 * text_px
    )
    rows = _rows_of(legend, picture.width - gap, first, text_px)
    line_px = round(1.6 * text_px)
    head = 2 * text_px if title else 0
    sheet = Image.new("RGB", (picture.width, head + picture.height + line_px * len(rows) + gap), ink.PAPER)
    sheet.paste(picture, (0, head))
    draw = ImageDraw.Draw(sheet)
    if title:
        draw.text((gap, head // 2), title, fill=ink.INK, font=font, anchor="lm")
    middle = head + picture.height + line_px // 2
    half = max(text_px // 8, 1)
    draw.rectangle((gap, middle - half, gap + bar_px, middle + half), fill=ink.INK)
    at = gap + bar_px + 0.4 * text_px
    draw.text((at, middle), f"{length_m:g} m", fill=ink.INK, font=font, anchor="lm")
    draw.text(
        (at + font.getlength(f"{length_m:g} m") + 1.5 * text_px, middle),
        cell,
        fill=ink.INK,
        font=font,
        anchor="lm",
    )
    for number, row in enumerate(rows):
        for x, entry in row:
            _draw_entry(draw, (x, middle + number * line_px), entry, text_px)
    return sheet


def _rows_of(
    legend: Sequence[LegendEntry], width_px: float, first_px: float, text_px: int
) -> list[list[tuple[float, LegendEntry]]]:
    """The entries in rows of a width; the first row begins at `first_px`."""
    rows: list[list[tuple[float, LegendEntry]]] = [[]]
    at = first_px
    for entry in legend:
        needed = 1.5 * text_px + _font(text_px).getlength(entry.text) + text_px
        if at + needed > width_px and (rows[-1] or len(rows) == 1):
            rows.append([])
            at = round(0.6 * text_px)
        rows[-1].append((at, entry))
        at += needed
    return rows


def _draw_entry(draw: ImageDraw.ImageDraw, at: tuple[float, float], entry: LegendEntry, text_px: int) -> None:
    x, y = at
    r = 0.4 * text_px
    if entry.mark == "area":
        draw.rectangle((x, y - r, x + 2.5 * r, y + r), fill=entry.colour, outline=ink.INK)
    elif entry.mark == "dot":
        draw.ellipse((x + 0.25 * r, y - r, x + 2.25 * r, y + r), fill=entry.colour)
    elif entry.mark == "line":
        draw.line((x, y, x + 2.5 * r, y), fill=entry.colour, width=max(text_px // 5, 2))
    else:
        width = max(text_px // 8, 2)
        draw.line((x + 0.2 * r, y + 0.8 * r, x + 2.5 * r, y + 0.8 * r), fill=ink.AXIS_X, width=width)
        draw.line((x + 0.2 * r, y + 0.8 * r, x + 0.2 * r, y - r), fill=ink.AXIS_Y, width=width)
    draw.text((x + 1.3 * text_px, y), entry.text, fill=ink.INK, font=_font(text_px), anchor="lm")


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)


def _round_length(length_m: float) -> float:
    """The largest length of 1, 2 or 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length_m))
    return float(power * max(step for step in (1, 2, 5) if step * power <= length_m * (1 + 1e-9)))
