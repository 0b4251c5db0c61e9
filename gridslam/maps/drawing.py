"""Hand-drawn maps: a picture of any paint program read as brightness, and found in it what is wall and what is free.

The *drawing frame* has its origin at the lower-left corner of the picture, x to the right and y up, in metres at the
nominal 0.1 m a pixel (handmap-slam, paper section 4). How many of these a metre of the world is, the localization finds.
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
MOST_PIXELS = 16_000_000
LEAST_SIDE_PX = 16
LEAST_CONTRAST = 32  # of 255, between the darker and the brighter class

FORMATS = ("PNG", "JPEG", "BMP", "GIF", "TIFF", "WEBP", "PPM")
DAMAGE = (OSError, ValueError, SyntaxError, EOFError, IndexError, struct.error, zlib.error)

WallColour = Literal["auto", "dark", "bright"]


@dataclass(frozen=True, slots=True)
class Drawing:
    """Brightness `levels` uint8 `(rows, cols)`, row 0 = bottom, transparency laid over paper; `name` for messages."""

    levels: NDArray[np.uint8]
    name: str

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height in the drawing frame."""
        rows, cols = self.levels.shape
        return cols * RESOLUTION_M, rows * RESOLUTION_M


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """What a drawing says: bool arrays `(rows, cols)`, row 0 = bottom, in the drawing frame.

    `free` is where the robot can get to from its start; `walls` are the drawn surfaces about it and about all other
    enclosed space, and lines across gaps that would let the outside in. `walls_are` tells their colour, `is_open` that no
    outline encloses the free space.
    """

    free: NDArray[np.bool_]
    walls: NDArray[np.bool_]
    walls_are: Literal["dark", "bright"]
    is_open: bool
    geometry: GridGeometry


def load_drawing(path: Path) -> Drawing:
    """Read a picture. Raises MapError: not a picture, absurdly large or small, or all of one colour."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of sizes and of odd palettes
            with Image.open(path, formats=FORMATS) as image:
                _check_size(path, *image.size)
                levels = _brightness(image)
    except Image.DecompressionBombError:
        raise MapError(f"{path}: the drawing has more than {MOST_PIXELS} pixels; draw it smaller") from None
    except DAMAGE as error:
        raise MapError(f"{path}: not a readable picture ({error}); save the drawing as PNG or JPEG") from None
    darkest, brightest = np.percentile(levels, [0.02, 99.98])
    if brightest - darkest < LEAST_CONTRAST:
        raise MapError(
            f"{path}: the drawing is all of one colour; draw the walls darker or brighter than the paper"
        )
    return Drawing(np.ascontiguousarray(levels[::-1]), path.name)


def drawn_map(
    drawing: Drawing,
    walls_are: WallColour = "auto",
    gap_m: float = 0.3,
    start_xy_m: tuple[float, float] | None = None,
) -> DrawnMap:
    """Tell walls from free space.

    The colour of the walls is the one that the start `(x, y)` does not lie in; without a start that of thin structures, or where
    nothing is thin that of the picture's edge. Free is what the start lies in, or the largest enclosed space. Gaps in strokes
    up to `gap_m` (drawing metres) are closed.

    Raises MapError: there is no free space. ConfigError: the start is outside of the picture.
    """
    cell = _start_cell(drawing, start_xy_m)
    dark = classes_of(drawing.levels)
    regions = regions_of(dark, walls_are, round(gap_m / RESOLUTION_M), cell)
    if regions is None:
        raise MapError(
            f"{drawing.name}: no free space was found in the drawing; "
            "set method.drawing.walls_are to dark or bright, and close the outline of the place"
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


def _start_cell(drawing: Drawing, start_xy_m: tuple[float, float] | None) -> tuple[int, int] | None:
    if start_xy_m is None:
        return None
    width, height = drawing.size_m
    x, y = start_xy_m
    if not (0.0 <= x < width and 0.0 <= y < height):
        raise ConfigError(
            f"{drawing.name}: the start ({x:g}, {y:g}) lies outside of the drawing, which is {width:g} x {height:g} m "
            "at 0.1 m a pixel, measured from its lower-left corner; correct method.start"
        )
    return int(y / RESOLUTION_M), int(x / RESOLUTION_M)


def _check_size(path: Path, width: int, height: int) -> None:
    if min(width, height) < LEAST_SIDE_PX:
        raise MapError(
            f"{path}: {width} x {height} pixels show no place; at least {LEAST_SIDE_PX} a side are needed"
        )
    if width * height > MOST_PIXELS:
        raise MapError(
            f"{path}: {width} x {height} pixels, at most {MOST_PIXELS} are read; scale the drawing down"
        )


def _brightness(image: Image.Image) -> NDArray[np.uint8]:
    """Brightness `(rows, cols)`, top row first.

    What is transparent is paper: white, or black where what is drawn is bright.
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
