"""Hand-drawn maps: reads a picture, separates walls from free space, and notes what it ignored.

The *drawing frame* has its origin at the lower left corner of the picture, x to the right and y up. Its lengths are drawing
units, 0.1 per pixel (handmap-slam, paper section 4). Localization estimates how many drawing units a metre is.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.drawings.drawing_picture import FORMATS as FORMATS
from gridslam.maps.drawings.drawing_picture import MAX_PIXELS as MAX_PIXELS
from gridslam.maps.drawings.drawing_picture import brightness_of, is_photograph, read_picture
from gridslam.maps.drawings.drawing_regions import Regions, classes_of, regions_of
from gridslam.maps.drawings.drawing_sheet import find_sheet, flattened
from gridslam.maps.occupancy import GridGeometry

RESOLUTION_M = 0.1
MIN_CONTRAST = 32  # smallest contrast of the darker and the brighter class, of 255
MIN_CONTRAST_PHOTOGRAPH = 20
PHOTOGRAPH_GAP = 0.01  # of the longer side

WallColour = Literal["auto", "dark", "bright"]


@dataclass(frozen=True, slots=True)
class Drawing:
    """Brightness `levels` uint8 `(rows, cols)`, row 0 at the bottom, transparent pixels as paper; `name` is for messages.

    `is_photograph` is false for pictures from a paint program; `is_rectified` says that a sheet's perspective was undone, so
    that the drawing is the sheet.
    """

    levels: NDArray[np.uint8]
    name: str
    is_photograph: bool = False
    is_rectified: bool = False

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in drawing units."""
        rows, cols = self.levels.shape
        return cols * RESOLUTION_M, rows * RESOLUTION_M


@dataclass(frozen=True, slots=True)
class Reading:
    """Findings of reading a drawing. Bool arrays `(rows, cols)` have row 0 at the bottom.

    `ignored` are strokes taken for text, arrows and specks, `enclosed` is space within walls other than the free space;
    `texts`, `arrows`, `specks` and `gaps_closed` are numbers.
    """

    light_evened: bool
    perspective_undone: bool
    gaps_closed: int
    texts: int
    arrows: int
    specks: int
    ignored: NDArray[np.bool_]
    enclosed: NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class DrawnMap:
    """A drawing as bool arrays `(rows, cols)`, row 0 at the bottom, in the drawing frame.

    `free` is the space that the robot can reach from its start; `walls` are the drawn surfaces around it and around all
    other enclosed space, and lines that close gaps to the outside. `walls_are` is their colour, `is_open` whether no outer
    wall encloses the free space, `reading` how the drawing was read (None if the map was not read from one).
    """

    free: NDArray[np.bool_]
    walls: NDArray[np.bool_]
    walls_are: Literal["dark", "bright"]
    is_open: bool
    geometry: GridGeometry
    reading: Reading | None = None


def load_drawing(path: Path) -> Drawing:
    """Read a picture; a sheet of paper photographed on a table is rectified.

    Raises MapError if it is no picture, too large or too small, or of one colour.
    """
    pixels = read_picture(path)
    photograph = is_photograph(pixels)
    corners = find_sheet(pixels) if photograph else None
    levels = brightness_of(pixels if corners is None else flattened(pixels, corners))
    darkest, brightest = np.percentile(levels, [0.02, 99.98])
    if brightest - darkest < (MIN_CONTRAST_PHOTOGRAPH if photograph else MIN_CONTRAST):
        raise MapError(
            f"{path}: the drawing has only one colour; draw the walls darker or brighter than the paper"
        )
    return Drawing(np.ascontiguousarray(levels[::-1]), path.name, photograph, corners is not None)


def drawn_map(
    drawing: Drawing,
    walls_are: WallColour = "auto",
    max_gap: float = 0.3,
    start_xy: tuple[float, float] | None = None,
) -> DrawnMap:
    """Separate walls from free space.

    The walls have the colour that is not at the start `(x, y)`. Without a start they have the colour of thin structures, or
    that of the picture's edge if nothing is thin. The free space is the region of the start, or the largest enclosed one.
    Gaps in strokes up to `max_gap` (drawing units) are closed. Text and arrows that are not joined to walls are ignored.

    Raises MapError if there is no free space, and ConfigError if the start lies outside the picture.
    """
    cell = _start_cell(drawing, start_xy)
    dark, light_evened = classes_of(drawing.levels, drawing.is_photograph)
    regions = regions_of(dark, walls_are, _gap_px(drawing, max_gap), cell)
    if regions is None:
        raise MapError(
            f"{drawing.name}: no free space was found in the drawing; "
            "set method.drawing.walls_are to dark or bright, and close the outer walls of the place"
        )
    return DrawnMap(
        free=_frozen(regions.free),
        walls=_frozen(regions.walls),
        walls_are=_colour(regions),
        is_open=regions.is_open,
        geometry=GridGeometry(RESOLUTION_M, (0.0, 0.0)),
        reading=_reading(drawing, regions, light_evened),
    )


def _gap_px(drawing: Drawing, max_gap: float) -> int:
    """Widest gap that is closed; in a photograph, whose pixels are small, it is a fraction of the picture if that is wider."""
    gap = round(max_gap / RESOLUTION_M)
    return (
        max(gap, round(PHOTOGRAPH_GAP * max(drawing.levels.shape))) if drawing.is_photograph and gap else gap
    )


def _reading(drawing: Drawing, regions: Regions, light_evened: bool) -> Reading:
    return Reading(
        light_evened=light_evened,
        perspective_undone=drawing.is_rectified,
        gaps_closed=regions.gaps_closed,
        texts=regions.marks.texts,
        arrows=regions.marks.arrows,
        specks=regions.marks.specks,
        ignored=_frozen(regions.marks.ignored),
        enclosed=_frozen(regions.enclosed),
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
