"""The cells of a map as the pixels of a picture, with tints over them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.picture import ink
from gridslam.maps.picture.ink import Canvas, Colour
from gridslam.maps.picture.window import MapWindow

Opacity: TypeAlias = NDArray[np.float32]

BLOCKS_AT_ONCE = 16  # rows of a shrunk map that are made at once: large maps take much memory
WALL_PROBABILITY = 0.5  # probability from which a cell has no tint
UNKNOWN = -1.0


@dataclass(frozen=True, slots=True)
class Tint:
    """A colour over cells of the map. `opacity` gives the opacities in [0, 1] of a slice of rows and of columns; `name` is for
    the legend.
    """

    opacity: Callable[[slice, slice], Opacity]
    colour: Colour
    name: str


def cell_colours(grid: OccupancyGrid, window: MapWindow) -> Canvas:
    """The cells in a window as colours. A shrunk map shows the most occupied cell of each block, so that walls remain visible."""
    side = _block_side(window)
    rows, cols = (window.row1 - window.row0) // side, (window.col1 - window.col0) // side
    colours: Canvas = np.empty((rows, cols, 3), np.uint8)
    top = rows
    for cells in _strips(grid, window):
        colours[top - len(cells) : top] = _colours_of(cells)[::-1]
        top -= len(cells)
    return colours if colours.shape[1::-1] == window.size_px else np.array(_enlarged(colours, window))


def _colours_of(cells: NDArray[np.float32]) -> Canvas:
    """The colours of probabilities, which are UNKNOWN in unknown cells."""
    steps = np.rint(np.clip(cells, 0.0, 1.0) * 255.0).astype(np.uint8)
    occupancy = np.arange(256)[:, None] / 255.0
    table = np.rint(np.asarray(ink.FREE) * (1.0 - occupancy) + np.asarray(ink.WALL) * occupancy)
    colours = table.astype(np.uint8)[steps]
    colours[cells < 0.0] = ink.UNKNOWN
    return np.asarray(colours)


def apply_tint(canvas: Canvas, tint: Tint, grid: OccupancyGrid, window: MapWindow) -> None:
    """Blend a tint over the cells that are not walls."""
    top_first = np.concatenate(list(_strips(grid, window, tint)))[::-1]
    levels = np.rint(255.0 * np.clip(top_first, 0.0, 1.0)).astype(np.uint8)
    opacity = np.asarray(_enlarged(levels, window), np.float64)[..., None] / 255.0
    canvas[:] = np.rint((1.0 - opacity) * canvas + opacity * np.asarray(tint.colour))


def _strips(
    grid: OccupancyGrid, window: MapWindow, tint: Tint | None = None
) -> Iterator[NDArray[np.float32]]:
    """The probabilities in a window or, with a tint, its opacities (0 on walls), in strips of rows, the lowest strip first.

    A shrunk map has one value per block of cells, the highest. Cells outside the grid, and those without a probability, are
    UNKNOWN.
    """
    side = _block_side(window)
    at_once = side * BLOCKS_AT_ONCE
    for first in range(window.row0, window.row1, at_once):
        rows = first, min(first + at_once, window.row1)
        yield _highest_of_blocks(grid.probability, tint, rows, (window.col0, window.col1), side)


def _block_side(window: MapWindow) -> int:
    """Side (cells) of the square blocks that a shrunk map shows as one pixel; 1 if it is not shrunk."""
    return round(1.0 / window.zoom) if window.zoom < 1.0 else 1


def _enlarged(cells: NDArray[np.uint8], window: MapWindow) -> Image.Image:
    """The cells as an image of the window's size in pixels."""
    return Image.fromarray(np.ascontiguousarray(cells)).resize(window.size_px, Image.Resampling.NEAREST)


def _highest_of_blocks(
    probability: NDArray[np.float32],
    tint: Tint | None,
    row_limits: tuple[int, int],
    col_limits: tuple[int, int],
    side: int,
) -> NDArray[np.float32]:
    """The highest value of each block of `side` x `side` cells within the limits, which may lie outside the grid."""
    (row0, row1), (col0, col1) = row_limits, col_limits
    cells = np.full((row1 - row0, col1 - col0), UNKNOWN, np.float32)
    rows, cols = probability.shape
    r0, r1, c0, c1 = max(row0, 0), min(row1, rows), max(col0, 0), min(col1, cols)
    if r0 < r1 and c0 < c1:
        part = np.nan_to_num(probability[r0:r1, c0:c1], nan=UNKNOWN)
        if tint is not None:
            part = np.where(part >= WALL_PROBABILITY, 0.0, tint.opacity(slice(r0, r1), slice(c0, c1)))
        cells[r0 - row0 : r1 - row0, c0 - col0 : c1 - col0] = part
    if side == 1:
        return cells
    blocks = cells.reshape(cells.shape[0] // side, side, cells.shape[1] // side, side)
    return np.asarray(blocks.max(axis=(1, 3)))
