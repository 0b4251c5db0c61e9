"""Scoring of scans on a hand-drawn map, in which a metre of the world has an unknown and stretched length."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled_parallel


@compiled_parallel
def sum_over_stretched_points(
    field: NDArray[np.float32],
    resolution_m: float,
    table: NDArray[np.float32],
    entries_per_m: float,
    points: NDArray[np.float64],
    states: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sum of table values `(n,)` over the points `(m, 2)` seen by robots in states `(n, 5)`.

    A state is x, y (drawing metres), yaw, and the logarithms of the scales along the drawing's axes (drawing metres per metre).
    `field` `(rows, cols)` is the distance to the nearest drawn wall (drawing metres). A point's distance counts in metres
    of the world, the mean scale being the measure, times `entries_per_m` as the table's index; beyond the table and outside of
    the drawing its last entry counts.
    """
    rows, cols = field.shape
    n, m = states.shape[0], points.shape[0]
    last = table.shape[0] - 1
    beyond = table[last]
    sums = np.empty(n)
    for i in prange(n):
        scale_x, scale_y = np.exp(states[i, 3]), np.exp(states[i, 4])
        c, s = np.cos(states[i, 2]), np.sin(states[i, 2])
        xx, xy = c * scale_x / resolution_m, -s * scale_x / resolution_m
        yx, yy = s * scale_y / resolution_m, c * scale_y / resolution_m
        # One cell is added before truncation, which then is the floor for all that lies inside.
        x, y = states[i, 0] / resolution_m + 1.0, states[i, 1] / resolution_m + 1.0
        per_unit = entries_per_m / np.sqrt(scale_x * scale_y)
        total = 0.0
        for k in range(m):
            px, py = points[k, 0], points[k, 1]
            col = int(x + xx * px + xy * py) - 1
            row = int(y + yx * px + yy * py) - 1
            if 0 <= col < cols and 0 <= row < rows:
                entry = int(field[row, col] * per_unit + 0.5)
                total += table[entry] if entry < last else beyond
            else:
                total += beyond
        sums[i] = total
    return sums
