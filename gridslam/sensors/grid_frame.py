"""Conversion of map poses to the frame of a grid: along the grid's axes, lengths in cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry

Floats = NDArray[np.float64]


def poses_in_cells(geometry: GridGeometry, poses: Floats) -> Floats:
    """Map poses `(n, 3)` as x, y (cells from the grid's lower-left corner) and yaw (rad from the grid's x axis)."""
    x, y, yaw = (  # column by column: numpy is several times slower along an axis of three
        poses[:, column] - offset for column, offset in enumerate((*geometry.origin_xy_m, geometry.yaw_rad))
    )
    if geometry.yaw_rad:
        cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
        x, y = cos * x + sin * y, cos * y - sin * x
    local = np.empty((len(poses), 3))
    local[:, 0], local[:, 1], local[:, 2] = x / geometry.resolution_m, y / geometry.resolution_m, yaw
    return local
