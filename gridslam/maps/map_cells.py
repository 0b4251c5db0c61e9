"""Cell values of nav2's map_server: whole percent of occupancy (0 to 100), or UNKNOWN (-1), as int8.

They are converted from and to the pixels of an image, top row first, and the probabilities of a grid, bottom row first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.maps.image_levels import ImageLevels
from gridslam.maps.map_yaml import Mode
from gridslam.maps.occupancy import OccupancyGrid

Cells = NDArray[np.int8]

UNKNOWN = -1
PIXEL_OCCUPIED, PIXEL_FREE, PIXEL_UNKNOWN = 0, 254, 205
TRINARY_THRESHOLDS = (0.65, 0.196)
SCALE_THRESHOLDS = (1.0, 0.0)
ROWS_PER_BLOCK = 64  # rows converted together, which bounds the memory for indices and probabilities
_PROBABILITY_OF_CELL = np.append(np.arange(101, dtype=np.float32) / np.float32(100), np.float32(np.nan))


@dataclass(frozen=True, slots=True)
class Thresholds:
    """Smallest occupancy (0 to 1) of an occupied cell, and largest of a free one.

    Raises ConfigError: not 0 <= free < occupied <= 1.
    """

    occupied: float
    free: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.free < self.occupied <= 1.0:
            raise ConfigError(
                f"map thresholds: free {self.free:g}, occupied {self.occupied:g}; "
                "expected 0 <= free < occupied <= 1"
            )


def cells_of_image(
    image: ImageLevels, mode: Mode, occupied_thresh: float, free_thresh: float, negate: bool
) -> Cells:
    """The cell values `(rows, cols)` of an image, the lower-left cell first."""
    brightness = np.arange(image.maximum + 1) / image.maximum
    if mode == "raw":
        cell_of_level = _raw_cells(brightness)
    else:
        occupancy = brightness if negate else 1.0 - brightness
        cell_of_level = _threshold_cells(occupancy, occupied_thresh, free_thresh, graded=mode == "scale")
    top_first = look_up(cell_of_level, image.levels)
    if mode != "raw" and image.opaque is not None:
        top_first[~image.opaque] = UNKNOWN
    return top_first[::-1]


def look_up(table: NDArray[Any], index: NDArray[Any]) -> NDArray[Any]:
    """`table[index]` `(rows, cols)` for a table `(n,)`; index -1, of unknown cells, is the last entry."""
    if index.dtype.itemsize == 1:  # OpenCV is ten times as fast as numpy, for bytes
        import cv2

        of_byte = np.full(256, table[-1])  # index -1 is byte 255
        of_byte[: len(table)] = table
        return np.asarray(cv2.LUT(np.ascontiguousarray(index).view(np.uint8), of_byte))
    found = np.empty(index.shape, table.dtype)
    for first in range(0, len(index), ROWS_PER_BLOCK):
        rows = slice(first, first + ROWS_PER_BLOCK)
        found[rows] = table[index[rows]]
    return found


def _threshold_cells(
    occupancy: NDArray[np.float64], occupied_thresh: float, free_thresh: float, graded: bool
) -> Cells:
    """Cell values of occupancies from 0 to 1; between the thresholds graded from 0 to 100, or UNKNOWN."""
    between = np.full(occupancy.shape, float(UNKNOWN))
    if graded:
        span = occupied_thresh - free_thresh
        between = np.clip(np.rint((occupancy - free_thresh) / span * 100.0), 0.0, 100.0)
    cells = np.where(occupancy >= occupied_thresh, 100.0, between)
    return np.where(occupancy <= free_thresh, 0.0, cells).astype(np.int8)


def _raw_cells(brightness: NDArray[np.float64]) -> Cells:
    """Cell values of brightnesses from 0 to 1, which are pixel values in mode raw."""
    value = np.rint(brightness * 255.0)
    return np.where(value <= 100.0, value, float(UNKNOWN)).astype(np.int8)


def probability_of_cells(cells: Cells) -> NDArray[np.float32]:
    """The probabilities `(rows, cols)` of cell values, NaN for unknown cells."""
    return look_up(_PROBABILITY_OF_CELL, cells)


def cells_of_grid(grid: OccupancyGrid) -> Cells:
    """The cell values `(rows, cols)` of a grid. Raises ValueError: a probability lies outside [0, 1]."""
    cells = np.empty(grid.probability.shape, np.int8)
    for first in range(0, len(cells), ROWS_PER_BLOCK):
        block = slice(first, first + ROWS_PER_BLOCK)
        cells[block] = cells_of_probability(grid.probability[block])
    return cells


def cells_of_probability(probability: NDArray[np.floating]) -> Cells:
    """The cell values of probabilities, NaN in unknown cells. Raises ValueError: one lies outside [0, 1]."""
    known = ~np.isnan(probability)
    percent = np.where(known, probability, 0.0) * 100.0
    if percent.size and not (percent.min() >= 0.0 and percent.max() <= 100.0):
        raise ValueError("an occupancy probability lies outside [0, 1]")
    return np.where(known, np.rint(percent), float(UNKNOWN)).astype(np.int8)


def pixel_of_cell(mode: Mode, limits: Thresholds) -> NDArray[np.uint8]:
    """The pixel values `(102,)` of the cell values 0 to 100 and, at the end, UNKNOWN."""
    value = np.arange(101.0)
    if mode == "trinary":
        pixels = np.where(value >= np.rint(limits.occupied * 100.0), PIXEL_OCCUPIED, PIXEL_UNKNOWN)
        pixels = np.where(value <= np.rint(limits.free * 100.0), PIXEL_FREE, pixels)
        unknown = PIXEL_UNKNOWN
    elif mode == "scale":
        pixels, unknown = np.rint((100.0 - value) / 100.0 * 255.0), 128
    else:
        pixels, unknown = value, 255
    return np.append(pixels, unknown).astype(np.uint8)


def level_of_pixel(pixel: int, image: ImageLevels) -> int:
    """The level of an image for a pixel value from 0 to 255."""
    return round(pixel / 255 * image.maximum)
