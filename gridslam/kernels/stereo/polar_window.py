"""From a grid to rays, and from values along rays to the cells around the robot."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.stereo.chain import CellPriors
from gridslam.kernels.threads import run_in_ranges

Floats = NDArray[np.float64]


class GridRays(NamedTuple):
    """Rays in a grid, in cells: `origin` `(2,)` (x, y), `angles` `(m,)` (rad), range of the first cell's centre, number of cells.

    Consecutive cells of a ray are one cell apart.
    """

    origin: Floats
    angles: Floats
    first: float
    cells: int


class PolarWindow(NamedTuple):
    """c values of n cells along m rays, `values` `(c, m, n)`, and `default` `(c,)` where no ray is near.

    `bearings` `(m,)` (rad) ascend, in the axes of the map; `max_offset_rad` is the largest angle to a ray that counts as near.
    """

    values: Floats
    default: Floats
    bearings: Floats
    max_offset_rad: float


@compiled
def nearest_ray(bearings: Floats, angle: float, max_offset: float) -> int:
    """Index of the ray nearest to an angle, -1 if none is within `max_offset` (rad); `bearings` `(m,)` ascend."""
    low, high = 0, bearings.shape[0]
    while low < high:
        middle = (low + high) // 2
        if bearings[middle] < angle:
            low = middle + 1
        else:
            high = middle
    nearest = -1
    for i in (low - 1, low):
        if 0 <= i < bearings.shape[0] and abs(bearings[i] - angle) <= max_offset:
            max_offset, nearest = abs(bearings[i] - angle), i
    return nearest


def priors_of_rays(log_odds: Floats, rays: GridRays, prior_log_odds: float, correlation: float) -> CellPriors:
    """P(E) of the cells along rays, and the correlation of each with the one before it, `(m, count)`.

    `log_odds` `(rows, cols)` are relative to `prior_log_odds`. `correlation` is that of cells one cell apart; a diagonal step is
    longer (eq. 8), and a cell that is met again correlates by 1.
    """
    m, count = rays.angles.shape[0], rays.cells
    priors, correlations = np.empty((m, count)), np.empty((m, count))
    run_in_ranges(_priors_of_rays, m, (log_odds, rays, prior_log_odds, correlation, priors, correlations))
    return CellPriors(priors, correlations)


@compiled
def _priors_of_rays(
    begin: int,
    end: int,
    log_odds: Floats,
    rays: GridRays,
    prior_log_odds: float,
    correlation: float,
    priors: NDArray[np.float64],
    correlations: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `priors_of_rays`."""
    count, origin = rays.cells, rays.origin
    diagonal = correlation ** np.sqrt(2.0)
    for i in range(begin, end):
        dx, dy = np.cos(rays.angles[i]), np.sin(rays.angles[i])
        last_row, last_col = 0, 0
        for k in range(count):
            row = int(np.floor(origin[1] + (rays.first + k) * dy))
            col = int(np.floor(origin[0] + (rays.first + k) * dx))
            priors[i, k] = 1.0 / (1.0 + np.exp(-(log_odds[row, col] + prior_log_odds)))
            steps = abs(row - last_row) + abs(col - last_col)
            correlations[i, k] = 1.0 if steps == 0 else correlation if steps == 1 else diagonal
            last_row, last_col = row, col


def averaged_over_yaw(window: PolarWindow, yaw_offsets: Floats, weights: Floats, angles: Floats) -> Floats:
    """Values `(c, a, n)` at the `angles` `(a,)`: the mean over all rays rotated by `yaw_offsets` `(k,)` with `weights` `(k,)`."""
    channels, _, n = window.values.shape
    mean = np.empty((channels, angles.shape[0], n))
    run_in_ranges(_averaged_over_yaw, angles.shape[0], (window, yaw_offsets, weights, angles, mean))
    return mean


@compiled
def _averaged_over_yaw(
    first: int,
    last: int,
    window: PolarWindow,
    yaw_offsets: Floats,
    weights: Floats,
    angles: Floats,
    mean: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `averaged_over_yaw`."""
    polar, default = window.values, window.default
    channels, _, n = polar.shape
    for a in range(first, last):
        for c in range(channels):
            mean[c, a, :] = default[c]
        for t in range(yaw_offsets.shape[0]):
            i = nearest_ray(window.bearings, angles[a] - yaw_offsets[t], window.max_offset_rad)
            if i >= 0:
                for c in range(channels):
                    for k in range(n):
                        mean[c, a, k] += weights[t] * (polar[c, i, k] - default[c])


def window_of_rays(window: PolarWindow, first: float, corner: Floats, rows: int, cols: int) -> Floats:
    """Values `(c, rows, cols)` of the cells around the origin of rays.

    In cells: `first` is the range at which the rays' cells start, `corner` `(2,)` is x, y of the first cell's centre relative to
    the origin.
    """
    channels = window.values.shape[0]
    cells = np.empty((channels, rows, cols))
    run_in_ranges(_window_of_rays, rows, (window, first, corner, rows, cols, cells))
    return cells


@compiled
def _window_of_rays(
    begin: int,
    end: int,
    window: PolarWindow,
    first: float,
    corner: Floats,
    rows: int,
    cols: int,
    cells: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `window_of_rays`."""
    polar, bearings = window.values, window.bearings
    channels, _, n = polar.shape
    middle = 0.5 * (bearings[0] + bearings[-1])
    half_view = 0.5 * (bearings[-1] - bearings[0]) + window.max_offset_rad
    ahead_x, ahead_y, min_cosine = np.cos(middle), np.sin(middle), np.cos(min(half_view, np.pi))
    for row in range(begin, end):
        for col in range(cols):
            for c in range(channels):
                cells[c, row, col] = window.default[c]
            x, y = corner[0] + col, corner[1] + row
            distance = np.sqrt(x * x + y * y)
            k = int(np.floor(distance - first))
            if k < 0 or k >= n or x * ahead_x + y * ahead_y < min_cosine * distance:
                continue
            angle = np.arctan2(y, x)
            angle += 2.0 * np.pi * np.round((middle - angle) / (2.0 * np.pi))
            i = nearest_ray(bearings, angle, window.max_offset_rad)
            if i >= 0:
                for c in range(channels):
                    cells[c, row, col] = polar[c, i, k]
