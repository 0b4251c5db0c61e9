"""Steps of the particle filter that numpy cannot vectorise: systematic resampling and the count of occupied bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def systematic(weights: NDArray[np.float64], count: int, start: float) -> NDArray[np.int64]:
    """Indices `(count,)` of the particles that systematic resampling draws; `start` in [0, 1) is its random number.

    Weights `(n,)` need not be normalised; their sum must be positive (Thrun et al. 2005, table 4.4).
    """
    n = weights.shape[0]
    total = 0.0
    for i in range(n):
        total += weights[i]
    step = total / count
    ancestors = np.empty(count, np.int64)
    i = 0
    cumulative = weights[0]
    for k in range(count):
        position = (k + start) * step
        while cumulative <= position and i < n - 1:
            i += 1
            cumulative += weights[i]
        ancestors[k] = i
    return ancestors


@compiled
def occupied_bins(poses: NDArray[np.float64], chosen: NDArray[np.int64], bin_m: float, bin_rad: float) -> int:
    """Number of different bins (x, y, yaw) that the poses `(n, 3)` at the indices `chosen` `(k,)` occupy."""
    size = 1  # of a hash table with open addressing
    while size < 2 * chosen.shape[0] + 2:
        size *= 2
    slots = np.full((size, 3), -(1 << 60), np.int64)
    count = 0
    last_x = last_y = last_yaw = np.int64(-(1 << 60))
    for k in range(chosen.shape[0]):
        i = chosen[k]
        x = np.int64(np.floor(poses[i, 0] / bin_m))
        y = np.int64(np.floor(poses[i, 1] / bin_m))
        yaw = np.int64(np.floor(poses[i, 2] / bin_rad))
        if x == last_x and y == last_y and yaw == last_yaw:
            continue
        last_x, last_y, last_yaw = x, y, yaw
        slot = (x * 73856093 ^ y * 19349663 ^ yaw * 83492791) & (size - 1)
        while True:
            if slots[slot, 0] == x and slots[slot, 1] == y and slots[slot, 2] == yaw:
                break
            if slots[slot, 0] == -(1 << 60):
                slots[slot, 0], slots[slot, 1], slots[slot, 2] = x, y, yaw
                count += 1
                break
            slot = (slot + 1) & (size - 1)
    return count
