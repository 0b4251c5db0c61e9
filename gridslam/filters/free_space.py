"""The free space of a map, and poses sampled uniformly from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MapError
from gridslam.maps.occupancy import OccupancyGrid, nth_cells

Floats = NDArray[np.float64]


def free_cells(occupancy: OccupancyGrid, threshold: float) -> NDArray[np.bool_]:
    """Mask `(rows, cols)` of the known cells with at most this probability of occupancy.

    Raises MapError: the map has no such cell.
    """
    free = np.asarray(occupancy.probability <= threshold)  # not true of NaN
    if not free.any():
        raise MapError(
            "the map has no free cell where the robot could be; check the map's thresholds and mode"
        )
    return free


def draw_free_poses(
    free: NDArray[np.bool_], occupancy: OccupancyGrid, count: int, rng: np.random.Generator
) -> Floats:
    """Poses `(count, 3)` in the map frame, uniform over the free cells and all headings."""
    cells = nth_cells(free, rng.integers(0, int(free.sum()), count))
    geometry = occupancy.geometry
    within = (rng.random((count, 2)) - 0.5) * geometry.resolution_m
    rotation = np.array([0.0, 0.0, geometry.yaw_rad])
    xy = geometry.centres(cells) + se2.transform_points(rotation, within)
    return np.column_stack([xy, rng.uniform(-np.pi, np.pi, count)])
