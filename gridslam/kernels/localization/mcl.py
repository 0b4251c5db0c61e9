"""Steps of the particle filter that numpy cannot vectorise: systematic resampling and the count of occupied bins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

_EMPTY = -1
# Bins of position and heading in one number of 63 bits: bins repeat after 2^26 in position, which is farther than any map.
_BINS_MASK, _YAW_MASK = (1 << 26) - 1, (1 << 11) - 1


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
    slots = np.full(size, _EMPTY, np.int64)
    count, drawn, last = 0, -1, np.int64(_EMPTY)
    for k in range(chosen.shape[0]):
        i = chosen[k]
        if i == drawn:  # again: resampling gives the copies of a particle one after the other
            continue
        drawn = i
        x = np.int64(np.floor(poses[i, 0] / bin_m)) & _BINS_MASK
        y = np.int64(np.floor(poses[i, 1] / bin_m)) & _BINS_MASK
        yaw = np.int64(np.floor(poses[i, 2] / bin_rad)) & _YAW_MASK
        key = (x * (_BINS_MASK + 1) + y) * (_YAW_MASK + 1) + yaw
        if key == last:
            continue
        last = key
        slot = (x * 73856093 ^ y * 19349663 ^ yaw * 83492791) & (size - 1)
        while slots[slot] != key:
            if slots[slot] == _EMPTY:
                slots[slot] = key
                count += 1
                break
            slot = (slot + 1) & (size - 1)
    return count
