"""From values along rays to the cells of a window around the robot."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel

Floats = NDArray[np.float64]


@compiled
def nearest_ray(bearings: Floats, angle: float, reach: float) -> int:
    """Index of the ray nearest to an angle, -1 where none is within `reach`; `bearings` `(m,)` ascend."""
    low, high = 0, bearings.shape[0]
    while low < high:
        middle = (low + high) // 2
        if bearings[middle] < angle:
            low = middle + 1
        else:
            high = middle
    best = -1
    for i in (low - 1, low):
        if 0 <= i < bearings.shape[0] and abs(bearings[i] - angle) <= reach:
            reach, best = abs(bearings[i] - angle), i
    return best


@compiled_parallel
def window_of_rays(
    polar: Floats,
    rest: Floats,
    bearings: Floats,
    reach_rad: float,
    turns: Floats,
    weights: Floats,
    offset_m: Floats,
    resolution_m: float,
    first_m: float,
    half: int,
) -> Floats:
    """Values `(c, 2 half + 1, 2 half + 1)` of the cells around the origin of rays.

    `polar` `(c, m, n)` are c values of n cells (of `resolution_m`, from `first_m` on) along m rays with `bearings` `(m,)` in the
    map's axes, ascending; `rest` `(c,)` is what cells have that no ray is near. Each is the mean over the
    `turns` `(k,)` of all rays with `weights` `(k,)`. `offset_m` `(2,)` is the centre of the middle cell seen from the origin.
    """
    channels, _, n = polar.shape
    size = 2 * half + 1
    window = np.empty((channels, size, size))
    middle = 0.5 * (bearings[0] + bearings[-1])
    spread = 0.5 * (bearings[-1] - bearings[0]) + reach_rad + np.abs(turns).max()
    ahead_x, ahead_y, least = np.cos(middle), np.sin(middle), np.cos(min(spread, np.pi))
    for row in prange(size):
        for col in range(size):
            for c in range(channels):
                window[c, row, col] = rest[c]
            x = offset_m[0] + (col - half) * resolution_m
            y = offset_m[1] + (row - half) * resolution_m
            range_m = np.sqrt(x * x + y * y)
            k = int(np.floor((range_m - first_m) / resolution_m))
            if k < 0 or k >= n or x * ahead_x + y * ahead_y < least * range_m:
                continue
            angle = np.arctan2(y, x)
            angle += 2.0 * np.pi * np.round((middle - angle) / (2.0 * np.pi))
            for t in range(turns.shape[0]):
                i = nearest_ray(bearings, angle - turns[t], reach_rad)
                if i >= 0:
                    for c in range(channels):
                        window[c, row, col] += weights[t] * (polar[c, i, k] - rest[c])
    return window
