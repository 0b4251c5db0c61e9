"""Cells of the map that the camera could see: the free space around the robot, and the surfaces that bound it."""

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
    """Mask `(rows, cols)` of the `reached` cells that were visible from the positions of the camera.

    After a false match behind a wall that was not known yet, a ray seems to have reached invisible cells. Visible free cells are
    connected to a free cell within `near` cells of one of the `cameras` `(n, 2)` (row, col). Other visible cells lie within
    `surface` cells of visible free cells.
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
