"""Steps of the particle filter that are loops by nature: resampling, and counting bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def systematic(weights: NDArray[np.float64], count: int, start: float) -> NDArray[np.int64]:
    """Ancestors `(count,)` by systematic resampling: one comb of `count` teeth, shifted by `start` in [0, 1), over the weights.

    Weights `(n,)` need not be normalised; their sum must be positive (Thrun et al. 2005, table 4.4).
    """
    n = weights.shape[0]
    total = 0.0
    for i in range(n):
        total += weights[i]
    step = total / count
    ancestors = np.empty(count, np.int64)
    i = 0
    reached = weights[0]
    for k in range(count):
        tooth = (k + start) * step
        while reached <= tooth and i < n - 1:
            i += 1
            reached += weights[i]
        ancestors[k] = i
    return ancestors


@compiled
def occupied_bins(
    poses: NDArray[np.float64], chosen: NDArray[np.int64], cell_m: float, cell_rad: float
) -> int:
    """Number of different bins (x, y, yaw) among the chosen `(k,)` of the poses `(n, 3)`, by open addressing."""
    size = 1
    while size < 2 * chosen.shape[0] + 2:
        size *= 2
    slots = np.full((size, 3), -(1 << 60), np.int64)
    count = 0
    last_x = last_y = last_yaw = np.int64(-(1 << 60))
    for k in range(chosen.shape[0]):
        i = chosen[k]
        x = np.int64(np.floor(poses[i, 0] / cell_m))
        y = np.int64(np.floor(poses[i, 1] / cell_m))
        yaw = np.int64(np.floor(poses[i, 2] / cell_rad))
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
