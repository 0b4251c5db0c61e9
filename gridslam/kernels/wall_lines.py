"""Straight pieces of wall under points: their lines by total least squares, and the normal equations of points on them.

Sums of points are `(..., 7)`: count, w, wx, wy, wxx, wxy, wyy, with weights w. A line is a piece of wall where it has enough
points, is thinner than a limit, and at least twice as long as thick.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@compiled
def pooled_sums(values: Floats, cells: Ints, reach: int) -> Floats:
    """Sums `(n, k)` of `values` (rows, cols, k) over windows of `reach` cells about `cells` `(n, 2)`; these may lie outside."""
    rows, cols, channels = values.shape
    sums = np.zeros((cells.shape[0], channels))
    for n in range(cells.shape[0]):
        for row in range(max(cells[n, 0] - reach, 0), min(cells[n, 0] + reach + 1, rows)):
            for col in range(max(cells[n, 1] - reach, 0), min(cells[n, 1] + reach + 1, cols)):
                for k in range(channels):
                    sums[n, k] += values[row, col, k]
    return sums


@compiled
def _line(sums: Floats, least_points: float, thickest_m: float) -> tuple[bool, float, float, float, float]:
    """Whether sums `(7,)` are a piece of wall; its centre of gravity (x, y) and its unit normal (x, y)."""
    if sums[0] < least_points or sums[1] <= 0.0:
        return False, 0.0, 0.0, 0.0, 0.0
    x, y = sums[2] / sums[1], sums[3] / sums[1]
    xx, xy, yy = sums[4] / sums[1] - x * x, sums[5] / sums[1] - x * y, sums[6] / sums[1] - y * y
    half, root = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    across, along = math.sqrt(max(half - root, 0.0)), math.sqrt(max(half + root, 0.0))
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the direction along the line
    return across < thickest_m and along > 2.0 * across, x, y, -math.sin(angle), math.cos(angle)


@compiled
def _sum_up(sums: Floats, members: Ints, points: Floats, weights: Floats) -> None:
    """Let `sums` `(7,)` be those of the `members` `(k,)` of all points `(n, 2)` with their weights `(n,)`."""
    sums[:] = 0.0
    for k in members:
        w, x, y = weights[k], points[k, 0], points[k, 1]
        sums[0] += 1.0
        sums[1] += w
        sums[2] += w * x
        sums[3] += w * y
        sums[4] += w * x * x
        sums[5] += w * x * y
        sums[6] += w * y * y


@compiled
def _weight(off: float, variance: float, robust_sigmas: float) -> float:
    """Inverse variance, less for points far off (Geman and McClure)."""
    return 1.0 / variance / (1.0 + off * off / variance / (robust_sigmas * robust_sigmas)) ** 2


@compiled
def equations_on_lines(
    sums: Floats,
    cells: Ints,
    least_points: float,
    thickest_m: float,
    arms: Floats,
    directions: Floats,
    variances: Floats,
    map_variance: float,
    robust_sigmas: float,
    position: Floats,
) -> tuple[Floats, Floats, int]:
    """Normal equations of one pose: hessian `(3, 3)`, gradient `(3,)`, and how many points lie within 3 deviations of a wall.

    `sums` (rows, cols, 7) are the map's, `cells` `(n, 2)` those of the points, whose lines come from the 3 x 3 cells about them.
    `arms` `(n, 2)` lead from the robot's `position` `(2,)` to the points, `directions` `(n, 2)` are the beams', both in the axes
    of the map; `variances` `(n, 2)` are those along and across the beams.
    """
    hessian, gradient, near = np.zeros((3, 3)), np.zeros(3), 0
    pooled, jacobian = np.empty(7), np.empty(3)
    rows, cols = sums.shape[0], sums.shape[1]
    for n in range(cells.shape[0]):
        pooled[:] = 0.0
        for row in range(max(cells[n, 0] - 1, 0), min(cells[n, 0] + 2, rows)):
            for col in range(max(cells[n, 1] - 1, 0), min(cells[n, 1] + 2, cols)):
                for k in range(7):
                    pooled[k] += sums[row, col, k]
        is_wall, x, y, nx, ny = _line(pooled, least_points, thickest_m)
        if not is_wall:
            continue
        off = (position[0] + arms[n, 0] - x) * nx + (position[1] + arms[n, 1] - y) * ny
        share = (nx * directions[n, 0] + ny * directions[n, 1]) ** 2
        variance = share * variances[n, 0] + (1.0 - share) * variances[n, 1] + map_variance
        weight = _weight(off, variance, robust_sigmas)
        near += off * off < 9.0 * variance
        jacobian[0], jacobian[1], jacobian[2] = nx, ny, ny * arms[n, 0] - nx * arms[n, 1]
        for i in range(3):
            gradient[i] += weight * jacobian[i] * off
            for j in range(3):
                hessian[i, j] += weight * jacobian[i] * jacobian[j]
    return hessian, gradient, near


@compiled
def equations_of_walls(
    first: Ints,
    order: Ints,
    place: Ints,
    points: Floats,
    arms: Floats,
    directions: Floats,
    variances: Floats,
    bel: Floats,
    least_points: float,
    thickest_m: float,
    map_variance: float,
    robust_sigmas: float,
    places: int,
) -> tuple[Floats, Floats, Floats, Floats, Ints, Ints, Floats]:
    """Normal equations of residuals off = n (p - c) - d - a * along: poses of the places, and offset d and tilt a of each wall.

    Wall w has the points `order[first[w]:first[w + 1]]`, by place in ascending order. Points, arms from their robots, and
    directions `(n, 2)` are in the map, `variances` `(n, 2)` those along and across the beams; a point weighs its `bel`.

    Returns the blocks of the poses (places, 3, 3) and gradients (places, 3); of each wall the block (w, 3: dd, da, aa) and
    gradient (w, 2); and the mixed blocks (m, 2, 3) with the counts of their walls (w,) and their places (m,), wall by wall.
    """
    walls, most = first.shape[0] - 1, order.shape[0]
    by_place, gradients = np.zeros((places, 3, 3)), np.zeros((places, 3))
    of_walls, wall_gradients = np.zeros((walls, 3)), np.zeros((walls, 2))
    mixed, mixed_place, counts = np.zeros((most, 2, 3)), np.zeros(most, np.int64), np.zeros(walls, np.int64)
    sums, jacobian, pair, weights = np.empty(7), np.empty(3), -1, bel / variances[:, 0]
    for wall in range(walls):
        _sum_up(sums, order[first[wall] : first[wall + 1]], points, weights)
        is_wall, x, y, nx, ny = _line(sums, least_points, thickest_m)
        if not is_wall:
            continue
        last = -1
        for k in order[first[wall] : first[wall + 1]]:
            p = place[k]
            if p != last:
                pair, last = pair + 1, p
                mixed_place[pair] = p
                counts[wall] += 1
            dx, dy = points[k, 0] - x, points[k, 1] - y
            off, along = dx * nx + dy * ny, dx * ny - dy * nx
            share = (nx * directions[k, 0] + ny * directions[k, 1]) ** 2
            variance = share * variances[k, 0] + (1.0 - share) * variances[k, 1] + map_variance
            weight = 0.5 * bel[k] * _weight(off, variance, robust_sigmas)
            jacobian[0], jacobian[1], jacobian[2] = nx, ny, ny * arms[k, 0] - nx * arms[k, 1]
            for i in range(3):
                gradients[p, i] += weight * jacobian[i] * off
                mixed[pair, 0, i] += weight * jacobian[i]
                mixed[pair, 1, i] += weight * jacobian[i] * along
                for j in range(3):
                    by_place[p, i, j] += weight * jacobian[i] * jacobian[j]
            of_walls[wall, 0] += weight
            of_walls[wall, 1] += weight * along
            of_walls[wall, 2] += weight * along * along
            wall_gradients[wall, 0] += weight * off
            wall_gradients[wall, 1] += weight * along * off
    used = pair + 1
    return by_place, gradients, of_walls, wall_gradients, counts, mixed_place[:used], mixed[:used]
