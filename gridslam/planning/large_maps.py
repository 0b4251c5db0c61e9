"""Maps with more cells than the planner takes at once: a part of them, or all of them in coarser cells."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

Floats = NDArray[np.float64]

MAX_CELLS = 4_000_000  # 100 m x 100 m at 5 cm; bounds time and memory of a plan
WINDOW_MARGIN_M = 30.0  # margin around start and goal
OCCUPIED, FREE = 1.0, 0.0


def window_around(occupancy: OccupancyGrid, start: Floats, goal: Floats) -> OccupancyGrid | None:
    """The part of a map around start and goal `(3,)` (m, rad; map frame), WINDOW_MARGIN_M wider on each side.

    None if it has more than MAX_CELLS cells, or if start or goal lies outside the map.
    """
    geometry = occupancy.geometry
    cells = geometry.cells(np.array([start[:2], goal[:2]]))
    shape = np.array(occupancy.probability.shape)
    if not ((cells >= 0) & (cells < shape)).all():
        return None
    margin = math.ceil(WINDOW_MARGIN_M / geometry.resolution_m)
    (r0, c0), (r1, c1) = (
        np.maximum(cells.min(axis=0) - margin, 0),
        np.minimum(cells.max(axis=0) + margin + 1, shape),
    )
    if (r1 - r0) * (c1 - c0) > MAX_CELLS:
        return None
    corner = geometry.centres(np.array([[r0, c0]]) - 0.5)[0]
    window = GridGeometry(geometry.resolution_m, (float(corner[0]), float(corner[1])), geometry.yaw_rad)
    return OccupancyGrid(occupancy.probability[r0:r1, c0:c1], window)


def coarsened(occupancy: OccupancyGrid, occupied_from: float) -> OccupancyGrid:
    """The map in larger cells, so that it has at most MAX_CELLS of them.

    A coarse cell is occupied if any of its cells is (P > `occupied_from`), otherwise unknown if any is unknown. So a path that
    is free on the coarse map is free on the original one.
    """
    rows, cols = occupancy.probability.shape
    factor = math.ceil(math.sqrt(rows * cols / MAX_CELLS))
    while math.ceil(rows / factor) * math.ceil(cols / factor) > MAX_CELLS:
        factor += 1
    coarse = np.empty((math.ceil(rows / factor), math.ceil(cols / factor)), np.float32)
    starts = np.arange(0, cols, factor)
    for row in range(len(coarse)):
        band = occupancy.probability[row * factor : (row + 1) * factor]
        is_occupied = np.logical_or.reduceat((band > occupied_from).any(axis=0), starts)
        is_unknown = np.logical_or.reduceat(np.isnan(band).any(axis=0), starts)
        coarse[row] = np.where(is_occupied, OCCUPIED, np.where(is_unknown, np.nan, FREE))
    # The last cells of an incomplete row or column reach beyond the map's edge, which blocks.
    if rows % factor:
        coarse[-1] = OCCUPIED
    if cols % factor:
        coarse[:, -1] = OCCUPIED
    geometry = occupancy.geometry
    coarse_geometry = GridGeometry(geometry.resolution_m * factor, geometry.origin_xy_m, geometry.yaw_rad)
    return OccupancyGrid(coarse, coarse_geometry)
