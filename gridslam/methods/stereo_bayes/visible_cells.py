"""Cells of the map that the cameras could see: the free space around the robot, and the surfaces that bound it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

MAX_FREE = 0.35  # probability of a free cell
EIGHT_NEIGHBOURS = np.ones((3, 3), int)


def visible_cells(
    probability: Floats, reached: Mask, cameras: NDArray[np.int64], near: float, surface: float
) -> Mask:
    """Mask `(rows, cols)` of the reached cells that are connected to the positions of the camera.

    A false match behind a wall, in a frame before the wall was known, lets a ray reach cells that are invisible: they are not
    connected to the free space within `near` cells of any of the `cameras` `(n, 2)` (row, col). Cells that are not free are
    visible only within `surface` cells of that free space.
    """
    free = reached & (probability < MAX_FREE)
    regions, _ = label(free, EIGHT_NEIGHBOURS)
    not_camera = np.ones(free.shape, bool)
    not_camera[cameras[:, 0], cameras[:, 1]] = False
    seeds = np.unique(regions[distance_transform_edt(not_camera) <= near])
    connected = np.isin(regions, seeds[seeds > 0])
    if not connected.any():
        return reached
    return np.asarray(reached & (distance_transform_edt(~connected) <= surface))
