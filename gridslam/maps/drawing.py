"""Hand-drawn maps: reads a picture as brightness, and separates walls from free space.

The *drawing frame* has its origin at the lower left corner of the picture, x to the right and y up. Its lengths are drawing
units, 0.1 per pixel (handmap-slam, paper section 4). Localization estimates how many drawing units a metre is.
"""

from __future__ import annotations

import struct
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.drawing_regions import Regions, classes_of, regions_of
from gridslam.maps.occupancy import GridGeometry

RESOLUTION_M = 0.1
MAX_PIXELS = 16_000_000
MIN_SIDE_PX = 16
MIN_CONTRAST = 32  # of 255, between the darker and the brighter class

FORMATS = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "PPM")
DAMAGE = (OSError, ValueError, SyntaxError, EOFError, IndexError, MemoryError, struct.error, zlib.error)

WallColour = Literal["auto", "dark", "bright"]


@dataclass(frozen=True, slots=True)
class Drawing:
    """Brightness `levels` uint8 `(rows, cols)`, row 0 at the bottom, transparent pixels as paper; `name` is for messages."""

    levels: NDArray[np.uint8]
    name: str

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in drawing units."""
        rows, cols = self.levels.shape
        return cols * RESOLUTION_M, rows * RESOLUTION_M


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """A drawing as bool arrays `(rows, cols)`, row 0 at the bottom, in the drawing frame.

    `free` is the space that the robot can reach from its start; `walls` are the drawn surfaces around it and around all
    other enclosed space, and lines that close gaps to the outside. `walls_are` is their colour, `is_open` whether no outer
    wall encloses the free space.
    """

    free: NDArray[np.bool_]
    walls: NDArray[np.bool_]
    walls_are: Literal["dark", "bright"]
    is_open: bool
    geometry: GridGeometry


def load_drawing(path: Path) -> Drawing:
    """Read a picture. Raises MapError if it is no picture, too large or too small, or of one colour."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns about sizes and unusual palettes
            with Image.open(path, formats=FORMATS) as image:
                _check_size(path, *image.size)
                levels = _brightness(image)
    except Image.DecompressionBombError:
        raise MapError(f"{path}: the drawing has more than {MAX_PIXELS} pixels; draw it smaller") from None
    except DAMAGE as error:
        raise MapError(f"{path}: not a readable picture ({error}); save the drawing as PNG or JPEG") from None
    darkest, brightest = np.percentile(levels, [0.02, 99.98])
    if brightest - darkest < MIN_CONTRAST:
        raise MapError(
            f"{path}: the drawing has only one colour; draw the walls darker or brighter than the paper"
        )
    return Drawing(np.ascontiguousarray(levels[::-1]), path.name)


def drawn_map(
    drawing: Drawing,
    walls_are: WallColour = "auto",
    max_gap: float = 0.3,
    start_xy: tuple[float, float] | None = None,
) -> DrawnMap:
    """Separate walls from free space.

    The walls have the colour that is not at the start `(x, y)`. Without a start they have the colour of thin structures, or
    that of the picture's edge if nothing is thin. The free space is the region of the start, or the largest enclosed one.
    Gaps in strokes up to `max_gap` (drawing units) are closed.

    Raises MapError if there is no free space, and ConfigError if the start lies outside the picture.
    """
    cell = _start_cell(drawing, start_xy)
    dark = classes_of(drawing.levels)
    regions = regions_of(dark, walls_are, round(max_gap / RESOLUTION_M), cell)
    if regions is None:
        raise MapError(
            f"{drawing.name}: no free space was found in the drawing; "
            "set method.drawing.walls_are to dark or bright, and close the outer walls of the place"
        )
    geometry = GridGeometry(RESOLUTION_M, (0.0, 0.0))
    return DrawnMap(
        _frozen(regions.free), _frozen(regions.walls), _colour(regions), regions.is_open, geometry
    )


def _colour(regions: Regions) -> Literal["dark", "bright"]:
    return "dark" if regions.walls_are_dark else "bright"


def _frozen(array: NDArray[np.bool_]) -> NDArray[np.bool_]:
    array.flags.writeable = False
    return array


def _start_cell(drawing: Drawing, start_xy: tuple[float, float] | None) -> tuple[int, int] | None:
    if start_xy is None:
        return None
    width, height = drawing.size
    x, y = start_xy
    if not (0.0 <= x < width and 0.0 <= y < height):
        raise ConfigError(
            f"{drawing.name}: the start ({x:g}, {y:g}) lies outside the drawing, which is {width:g} x {height:g} drawing "
            "units (0.1 per pixel) from its lower left corner; correct method.start"
        )
    return int(y / RESOLUTION_M), int(x / RESOLUTION_M)


def _check_size(path: Path, width: int, height: int) -> None:
    if min(width, height) < MIN_SIDE_PX:
        raise MapError(
            f"{path}: {width} x {height} pixels are too small for a drawing; at least {MIN_SIDE_PX} per side are needed"
        )
    if width * height > MAX_PIXELS:
        raise MapError(
            f"{path}: {width} x {height} pixels, at most {MAX_PIXELS} are read; scale the drawing down"
        )


def _brightness(image: Image.Image) -> NDArray[np.uint8]:
    """Brightness `(rows, cols)`, top row first.

    Transparent pixels are paper: white, or black if the strokes are bright.
    """
    if image.mode.startswith(("I", "F")):
        values = np.asarray(image, dtype=np.float64)
        low, high = float(np.nanmin(values)), float(np.nanmax(values))
        scaled = (np.nan_to_num(values, nan=low) - low) * (255.0 / max(high - low, 1e-9))
        return np.rint(scaled).astype(np.uint8)
    rgba = np.asarray(image.convert("RGBA"))
    grey = cv2.cvtColor(np.ascontiguousarray(rgba[..., :3]), cv2.COLOR_RGB2GRAY).astype(np.float64)
    alpha = rgba[..., 3].astype(np.float64) / 255.0
    drawn = alpha > 0.5
    strokes_are_bright = bool((~drawn).mean() > 0.05 and drawn.any() and np.median(grey[drawn]) > 127.0)
    paper = 0.0 if strokes_are_bright else 255.0
    return np.rint(grey * alpha + paper * (1.0 - alpha)).astype(np.uint8)
