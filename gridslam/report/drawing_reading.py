"""Picture and JSON document of a drawing as it was read."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from gridslam.core.files import write_atomic
from gridslam.maps.drawings.drawing import Drawing, DrawnMap

OUTSIDE, FREE, ENCLOSED = (214, 218, 224), (255, 255, 255), (176, 205, 235)
WALL, IGNORED, PAPER, GRID = (28, 32, 40), (225, 60, 140), (255, 255, 255), (110, 118, 130)
LEGEND = (
    ("free", FREE),
    ("wall", WALL),
    ("other enclosed space", ENCLOSED),
    ("ignored", IGNORED),
    ("outside", OUTSIDE),
)

MIN_SIDE_PX, MAX_SIDE_PX = 700, 1600
FONT_PX, MARGIN_PX, SWATCH_PX = 14, 44, 14
LEGEND_GAP_PX = 12
MAX_TICKS = 12


def reading_document(path: Path, drawing: Drawing, drawn: DrawnMap) -> dict[str, object]:
    """The findings in the drawing, as a JSON document."""
    reading = drawn.reading
    assert reading is not None
    return {
        "drawing": str(path),
        "size": [round(v, 1) for v in drawing.size],
        "walls_are": drawn.walls_are,
        "is_open": drawn.is_open,
        "is_photograph": drawing.is_photograph,
        "light_evened": reading.light_evened,
        "perspective_undone": reading.perspective_undone,
        "gaps_closed": reading.gaps_closed,
        "ignored": {"texts": reading.texts, "arrows": reading.arrows, "specks": reading.specks},
        "free_ratio": round(float(drawn.free.mean()), 4),
    }


def write_reading(path: Path, drawing: Drawing, drawn: DrawnMap) -> None:
    """Write the picture of `reading_picture` as PNG."""
    data = io.BytesIO()
    reading_picture(drawing, drawn).save(data, format="PNG")
    write_atomic(path, data.getvalue())


def reading_picture(drawing: Drawing, drawn: DrawnMap) -> Image.Image:
    """The drawing as it was understood, with its size in drawing units along the edges and a legend below."""
    colours = _colours(drawn)
    rows, cols = colours.shape[:2]
    scale = min(max(1.0, -(-MIN_SIDE_PX // max(rows, cols))), MAX_SIDE_PX / max(rows, cols))
    width, height = max(round(cols * scale), 1), max(round(rows * scale), 1)
    method = Image.Resampling.NEAREST if scale >= 1.0 else Image.Resampling.BOX
    body = Image.fromarray(np.ascontiguousarray(colours[::-1])).resize((width, height), method)
    font = ImageFont.load_default(FONT_PX)
    legend = _legend(width + 2 * MARGIN_PX, font, drawing)
    sheet = Image.new(
        "RGB", (width + 2 * MARGIN_PX, height + MARGIN_PX + LEGEND_GAP_PX + legend.height), PAPER
    )
    sheet.paste(body, (MARGIN_PX, MARGIN_PX // 2))
    sheet.paste(legend, (0, height + MARGIN_PX + LEGEND_GAP_PX))
    _draw_ticks(ImageDraw.Draw(sheet), font, drawing.size, (width, height))
    return sheet


def _colours(drawn: DrawnMap) -> NDArray[np.uint8]:
    """Colours `(rows, cols, 3)`, row 0 at the bottom."""
    reading = drawn.reading
    assert reading is not None
    colours = np.full((*drawn.free.shape, 3), OUTSIDE, np.uint8)
    colours[reading.enclosed] = ENCLOSED
    colours[drawn.free] = FREE
    colours[drawn.walls] = WALL
    colours[reading.ignored] = IGNORED
    return colours


def _draw_ticks(
    draw: ImageDraw.ImageDraw,
    font: ImageFont.FreeTypeFont | ImageFont.ImageFont,
    size: tuple[float, float],
    pixels: tuple[int, int],
) -> None:
    """Draw the axes of the drawing frame: x below the drawing, y to its left, both from the lower left corner."""
    (width, height), (left, top) = pixels, (MARGIN_PX, MARGIN_PX // 2)
    step = _tick_step(max(size))
    draw.rectangle((left - 1, top - 1, left + width, top + height), outline=GRID)
    for value in np.arange(0.0, size[0] + 1e-9, step):
        x = left + value / size[0] * width
        draw.line((x, top + height, x, top + height + 5), fill=GRID)
        draw.text((x, top + height + 7), f"{value:g}", fill=WALL, font=font, anchor="mt")
    for value in np.arange(0.0, size[1] + 1e-9, step):
        y = top + height - value / size[1] * height
        draw.line((left - 6, y, left - 1, y), fill=GRID)
        draw.text((left - 8, y), f"{value:g}", fill=WALL, font=font, anchor="rm")


def _tick_step(length: float) -> float:
    """The smallest step of 1, 2 or 5 times a power of ten with at most `MAX_TICKS` ticks."""
    power = 10.0 ** np.floor(np.log10(length / MAX_TICKS))
    return float(next(s * power for s in (1, 2, 5, 10) if length / (s * power) <= MAX_TICKS))


def _legend(width: int, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, drawing: Drawing) -> Image.Image:
    """The meaning of the colours, in as many lines as the width needs."""
    places, x, line = [], MARGIN_PX, 0
    for name, colour in LEGEND:
        needed = SWATCH_PX + 6 + round(font.getlength(name)) + 18
        if x + needed > width and x > MARGIN_PX:
            x, line = MARGIN_PX, line + 1
        places.append((name, colour, x, line))
        x += needed
    row_px = SWATCH_PX + 8
    legend = Image.new("RGB", (width, row_px * (line + 2) + 4), PAPER)
    draw = ImageDraw.Draw(legend)
    for name, colour, x, line in places:
        y = line * row_px
        draw.rectangle((x, y, x + SWATCH_PX, y + SWATCH_PX), fill=colour, outline=GRID)
        draw.text((x + SWATCH_PX + 6, y + SWATCH_PX / 2), name, fill=WALL, font=font, anchor="lm")
    across, up = drawing.size
    size = f"{across:g} x {up:g} drawing units"
    draw.text(
        (MARGIN_PX, (places[-1][3] + 1) * row_px + SWATCH_PX / 2), size, fill=WALL, font=font, anchor="lm"
    )
    return legend
