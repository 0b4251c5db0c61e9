"""Weights of the beam model: what the map says each beam should have measured, looked up against what it did."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled_parallel
from gridslam.kernels.raycast import cast


@compiled_parallel
def sum_over_beams(
    squares: NDArray[np.uint8],
    table: NDArray[np.float32],
    cells_per_bin: float,
    bearings: NDArray[np.float64],
    measured_bins: NDArray[np.int64],
    sensor: NDArray[np.float64],
    poses: NDArray[np.float64],
    reach: float,
) -> NDArray[np.float64]:
    """Sum of table[measured bin, expected bin] `(n,)` over the beams `(b,)`, the expected range by ray casting from each pose.

    Poses `(n, 3)` are the robot's (x, y in cells, yaw), `sensor` `(3,)` is T_base_sensor in cells; bearings are the sensor's.
    """
    n, b = poses.shape[0], bearings.shape[0]
    last = table.shape[1] - 1
    cos_b, sin_b = np.cos(bearings), np.sin(bearings)
    sums = np.empty(n)
    for i in prange(n):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        x = poses[i, 0] + c * sensor[0] - s * sensor[1]
        y = poses[i, 1] + s * sensor[0] + c * sensor[1]
        yaw = poses[i, 2] + sensor[2]
        c, s = np.cos(yaw), np.sin(yaw)
        total = 0.0
        for k in range(b):
            dx = c * cos_b[k] - s * sin_b[k]
            dy = s * cos_b[k] + c * sin_b[k]
            expected = cast(squares, x, y, dx, dy, reach)
            total += table[measured_bins[k], min(int(expected / cells_per_bin + 0.5), last)]
        sums[i] = total
    return sums
