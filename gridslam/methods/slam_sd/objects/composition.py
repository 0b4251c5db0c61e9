"""The composed map: the static map with the tagged objects where they stand now."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

Floats = NDArray[np.float64]

OCCUPIED = np.float32(0.97)  # probability
SHIFT = 4  # OpenCV takes corners in units of 2^-SHIFT pixels
SUBCELLS = 1 << SHIFT


def compose_map(static: OccupancyGrid, footprints: Sequence[Floats]) -> OccupancyGrid:
    """The static map with the footprints `(k, 2)` (map frame) drawn as occupied; the grid is extended to contain them."""
    if not footprints:
        return static
    grid = _extended(static, np.concatenate(footprints))
    probability = grid.probability.copy()
    geometry = grid.geometry
    for corners in footprints:
        mask = np.zeros(probability.shape, np.uint8)
        draw_polygon(mask, (corners - geometry.origin_xy_m) / geometry.resolution_m)
        probability[mask > 0] = OCCUPIED
    return OccupancyGrid(probability, geometry)


def draw_polygon(mask: NDArray[np.uint8], corners_cells: Floats) -> None:
    """Set the cells that a polygon covers; its corners are in cells (x, y) from the corner of cell (0, 0)."""
    pixels = np.rint((corners_cells - 0.5) * SUBCELLS).astype(np.int32)
    cv2.fillPoly(mask, [pixels], 1, cv2.LINE_8, SHIFT)


def _extended(grid: OccupancyGrid, points: Floats) -> OccupancyGrid:
    """The grid, extended to contain the points `(n, 2)`; new cells are unknown."""
    geometry = grid.geometry
    origin = np.array(geometry.origin_xy_m)
    rows, cols = grid.probability.shape
    cells = (points - origin) / geometry.resolution_m
    low = np.minimum(np.floor(cells.min(axis=0)).astype(int) - 1, 0)
    high = np.maximum(np.ceil(cells.max(axis=0)).astype(int) + 1, [cols, rows])
    if not low.any() and (high == [cols, rows]).all():
        return grid
    values = np.full((high[1] - low[1], high[0] - low[0]), np.nan, np.float32)
    values[-low[1] : rows - low[1], -low[0] : cols - low[0]] = grid.probability
    corner = origin + low * geometry.resolution_m
    return OccupancyGrid(values, GridGeometry(geometry.resolution_m, (float(corner[0]), float(corner[1]))))
