"""Conversion of map poses to the frame of a grid: along the grid's axes, lengths in cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry

Floats = NDArray[np.float64]


def poses_in_cells(geometry: GridGeometry, poses: Floats) -> Floats:
    """Map poses `(n, 3)` as x, y (cells from the grid's lower-left corner) and yaw (rad from the grid's x axis)."""
    local: Floats = poses - np.array([*geometry.origin_xy_m, geometry.yaw_rad])
    if geometry.yaw_rad:
        cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
        x, y = local[:, 0].copy(), local[:, 1]
        local[:, 0] = cos * x + sin * y
        local[:, 1] = cos * y - sin * x
    local[:, :2] /= geometry.resolution_m
    return local
