"""Lines, dots, areas, rasters and texts of a chart, written as SVG and painted as PNG.

A plotting library would take longer to load than all charts of an evaluation take to draw.
"""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from html import escape
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor, ImageDraw, ImageFont

from gridslam.core.arrays import cumulative_distance
from gridslam.core.texts import visible
from gridslam.maps.picture import ink

Floats = NDArray[np.float64]

PNG_SCALE = 2  # pixels of the PNG along each side of a pixel of the SVG: sharp on a dense screen and in print
PNG_LEVEL = 4  # level of compression: higher levels take longer and save little
DASH_PX, GAP_PX = 6.0, 4.0
MAX_DASHED_PX = 200_000.0  # a longer line is drawn without gaps, since it covers them itself
INK, PAPER = "#3c424c", "#ffffff"


@dataclass(frozen=True, slots=True)
class Stroke:
    """A polyline through points `(n, 2)`, all in pixels of the SVG, x to the right and y down."""

    points: Floats
    colour: str
    width: float
    is_dashed: bool = False


@dataclass(frozen=True, slots=True)
class Disc:
    """A filled circle."""

    x: float
    y: float
    radius: float
    colour: str


@dataclass(frozen=True, slots=True)
class Area:
    """A filled rectangle between two corners."""

    x0: float
    y0: float
    x1: float
    y1: float
    colour: str


@dataclass(frozen=True, slots=True)
class TextLine:
    """A line of text with its base line at y; its `anchor` (start, middle or end) is at x. `size` is that of the font (px)."""

    x: float
    y: float
    text: str
    size: int
    anchor: Literal["start", "middle", "end"] = "start"


@dataclass(frozen=True, slots=True)
class Raster:
    """Colours `(rows, cols, 3)` whose upper left corner is at (x, y), `PNG_SCALE` of them along each side of an SVG pixel."""

    x: float
    y: float
    colours: ink.Canvas


Shape: TypeAlias = Stroke | Disc | Area | TextLine | Raster


@dataclass(frozen=True, slots=True)
class DrawnSheet:
    """Shapes on a white sheet of a width and height in pixels of the SVG; later shapes cover earlier ones."""

    width: int
    height: int
    shapes: Sequence[Shape]


def text_width(text: str, size: int) -> float:
    """The width of a text on the PNG, in pixels of the SVG; other fonts are about as wide."""
    return float(_font(size * PNG_SCALE).getlength(visible(text))) / PNG_SCALE


def svg_of(drawing: DrawnSheet) -> str:
    """The drawing as an SVG element, its texts as text."""
    lines = [
        f'<svg viewBox="0 0 {drawing.width} {drawing.height}" width="{drawing.width}" height="{drawing.height}" '
        'xmlns="http://www.w3.org/2000/svg" font-family="sans-serif">',
        f'<rect width="{drawing.width}" height="{drawing.height}" fill="{PAPER}"/>',
        *(_element(shape) for shape in drawing.shapes),
        "</svg>\n",
    ]
    return "\n".join(lines)


def _element(shape: Shape) -> str:
    if isinstance(shape, Stroke):
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in shape.points.tolist())
        dashes = f' stroke-dasharray="{DASH_PX:g} {GAP_PX:g}"' if shape.is_dashed else ""
        return (
            f'<polyline fill="none" stroke="{shape.colour}" stroke-width="{shape.width:g}" stroke-linejoin="round" '
            f'stroke-linecap="round"{dashes} points="{points}"/>'
        )
    if isinstance(shape, Disc):
        return f'<circle cx="{shape.x:.1f}" cy="{shape.y:.1f}" r="{shape.radius:g}" fill="{shape.colour}"/>'
    if isinstance(shape, Area):
        return (
            f'<rect x="{shape.x0:.1f}" y="{shape.y0:.1f}" width="{shape.x1 - shape.x0:.1f}" '
            f'height="{shape.y1 - shape.y0:.1f}" fill="{shape.colour}"/>'
        )
    if isinstance(shape, Raster):
        rows, cols = shape.colours.shape[:2]
        data = b64encode(_png_bytes(Image.fromarray(shape.colours))).decode()
        return (
            f'<image x="{shape.x:.1f}" y="{shape.y:.1f}" width="{cols / PNG_SCALE:g}" height="{rows / PNG_SCALE:g}" '
            f'href="data:image/png;base64,{data}"/>'
        )
    return (
        f'<text x="{shape.x:.1f}" y="{shape.y:.1f}" font-size="{shape.size}" fill="{INK}" '
        f'text-anchor="{shape.anchor}">{escape(visible(shape.text))}</text>'
    )


def png_of(drawing: DrawnSheet) -> bytes:
    """The drawing as a PNG of `PNG_SCALE` times its size."""
    canvas = np.full((drawing.height * PNG_SCALE, drawing.width * PNG_SCALE, 3), 255, np.uint8)
    for shape in drawing.shapes:
        if not isinstance(shape, TextLine):
            _paint(canvas, shape)
    picture = Image.fromarray(canvas)
    draw = ImageDraw.Draw(picture)
    for shape in drawing.shapes:
        if isinstance(shape, TextLine):
            at = shape.x * PNG_SCALE, shape.y * PNG_SCALE
            anchor = {"start": "ls", "middle": "ms", "end": "rs"}[shape.anchor]
            draw.text(at, visible(shape.text), fill=INK, font=_font(shape.size * PNG_SCALE), anchor=anchor)
    return _png_bytes(picture)


def _png_bytes(picture: Image.Image) -> bytes:
    file = io.BytesIO()
    picture.save(file, format="PNG", compress_level=PNG_LEVEL)
    return file.getvalue()


def _paint(canvas: ink.Canvas, shape: Stroke | Disc | Area | Raster) -> None:
    if isinstance(shape, Raster):
        x, y = round(shape.x * PNG_SCALE), round(shape.y * PNG_SCALE)
        rows, cols = shape.colours.shape[:2]
        canvas[y : y + rows, x : x + cols] = shape.colours
        return
    colour = _rgb(shape.colour)
    if isinstance(shape, Stroke):
        points = shape.points * PNG_SCALE
        dash_px, gap_px = DASH_PX * PNG_SCALE, GAP_PX * PNG_SCALE
        for part in _dashes(points, dash_px, gap_px) if shape.is_dashed else [points]:
            ink.line(canvas, part, colour, shape.width * PNG_SCALE)
    elif isinstance(shape, Disc):
        ink.dots(canvas, np.array([[shape.x, shape.y]]) * PNG_SCALE, colour, shape.radius * PNG_SCALE)
    else:
        corners = np.array([shape.x0, shape.y0, shape.x1, shape.y1]) * PNG_SCALE
        x0, y0, x1, y1 = np.rint(corners).astype(int).tolist()
        canvas[y0:y1, x0:x1] = colour


def _dashes(points: Floats, dash_px: float, gap_px: float) -> Iterator[Floats]:
    """The dashes of a polyline `(n, 2)`; the whole polyline if it is so long that it would cover its own gaps."""
    travel = cumulative_distance(points)
    if travel[-1] > MAX_DASHED_PX:
        yield points
        return
    starts = np.arange(0.0, travel[-1], dash_px + gap_px)
    ends = np.minimum(starts + dash_px, travel[-1])
    tips = [
        np.stack([np.interp(at, travel, points[:, 0]), np.interp(at, travel, points[:, 1])], axis=1)
        for at in (starts, ends)
    ]
    after, before = np.searchsorted(travel, starts, side="right"), np.searchsorted(travel, ends)
    for k in range(len(starts)):
        yield np.concatenate([tips[0][k : k + 1], points[after[k] : before[k]], tips[1][k : k + 1]])


def _rgb(colour: str) -> ink.Colour:
    r, g, b = ImageColor.getrgb(colour)[:3]
    return r, g, b


@lru_cache(maxsize=8)
def _font(size: int) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)
