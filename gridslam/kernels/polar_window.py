"""From a grid to rays, and from values along rays to the cells around the robot."""

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
def priors_of_rays(
    log_odds: Floats, eye: Floats, angles: Floats, first: float, count: int, prior: float, correlation: float
) -> tuple[Floats, Floats]:
    """P(E) of the cells along rays, and the correlation of each with the one before it `(m, count)`.

    `log_odds` `(rows, cols)`, to which those of the `prior` are added; in cells of the grid, `eye` `(2,)` is the rays' origin
    (x, y) and `first` the range of the first cell's middle; the cells of a ray are one apart. `correlation` is that of cells one
    cell apart; a diagonal step is longer (eq. 8), and what falls into the same cell again is the same.
    """
    m = angles.shape[0]
    priors, correlations = np.empty((m, count)), np.empty((m, count))
    diagonal = correlation ** np.sqrt(2.0)
    for i in prange(m):
        dx, dy = np.cos(angles[i]), np.sin(angles[i])
        row_before, col_before = 0, 0
        for k in range(count):
            row, col = int(np.floor(eye[1] + (first + k) * dy)), int(np.floor(eye[0] + (first + k) * dx))
            priors[i, k] = 1.0 / (1.0 + np.exp(-(log_odds[row, col] + prior)))
            moved = abs(row - row_before) + abs(col - col_before)
            correlations[i, k] = 1.0 if moved == 0 else correlation if moved == 1 else diagonal
            row_before, col_before = row, col
    return priors, correlations


@compiled_parallel
def averaged_over_turns(
    polar: Floats,
    rest: Floats,
    bearings: Floats,
    reach_rad: float,
    turns: Floats,
    weights: Floats,
    angles: Floats,
) -> Floats:
    """Values `(c, a, n)` at the `angles` `(a,)`: the mean over all rays being turned by `turns` `(k,)` with `weights` `(k,)`.

    `polar` `(c, m, n)` are the values along the rays with `bearings` `(m,)`; `rest` `(c,)` is what there is where no ray is
    within `reach_rad`.
    """
    channels, _, n = polar.shape
    mean = np.empty((channels, angles.shape[0], n))
    for a in prange(angles.shape[0]):
        for c in range(channels):
            mean[c, a, :] = rest[c]
        for t in range(turns.shape[0]):
            i = nearest_ray(bearings, angles[a] - turns[t], reach_rad)
            if i >= 0:
                for c in range(channels):
                    for k in range(n):
                        mean[c, a, k] += weights[t] * (polar[c, i, k] - rest[c])
    return mean


@compiled_parallel
def window_of_rays(
    polar: Floats,
    rest: Floats,
    bearings: Floats,
    reach_rad: float,
    first: float,
    corner: Floats,
    rows: int,
    cols: int,
) -> Floats:
    """Values `(c, rows, cols)` of the cells around the origin of rays.

    `polar` `(c, m, n)` are c values of n cells along m rays with `bearings` `(m,)` in the map's axes, ascending; `rest` `(c,)`
    is what cells have that no ray is within `reach_rad` of. In cells: `first` is the range at which the rays' cells begin,
    `corner` `(2,)` x, y of the first cell's middle seen from the origin.
    """
    channels, _, n = polar.shape
    window = np.empty((channels, rows, cols))
    middle = 0.5 * (bearings[0] + bearings[-1])
    spread = 0.5 * (bearings[-1] - bearings[0]) + reach_rad
    ahead_x, ahead_y, least = np.cos(middle), np.sin(middle), np.cos(min(spread, np.pi))
    for row in prange(rows):
        for col in range(cols):
            for c in range(channels):
                window[c, row, col] = rest[c]
            x, y = corner[0] + col, corner[1] + row
            away = np.sqrt(x * x + y * y)
            k = int(np.floor(away - first))
            if k < 0 or k >= n or x * ahead_x + y * ahead_y < least * away:
                continue
            angle = np.arctan2(y, x)
            angle += 2.0 * np.pi * np.round((middle - angle) / (2.0 * np.pi))
            i = nearest_ray(bearings, angle, reach_rad)
            if i >= 0:
                for c in range(channels):
                    window[c, row, col] = polar[c, i, k]
    return window
