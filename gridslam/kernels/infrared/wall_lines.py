"""Straight wall segments under points: their lines by total least squares, and the normal equations of points on them.

Moments of points are `(..., 7)`: count, w, wx, wy, wxx, wxy, wyy, with weights w. A line is a wall segment if it has enough
points, is thinner than a limit, and is at least twice as long as thick.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COUNT, W, WX, WY, WXX, WXY, WYY = range(7)  # columns of moments
MOMENTS = 7  # number of columns
# Largest squared distance of a point on a wall, in variances: three standard deviations
ON_WALL_SQUARED = 9.0


class WallCriteria(NamedTuple):
    """Criteria for a wall segment, and the weighting of points on it.

    `map_variance` (m^2) is that of the wall about its straight line; residuals beyond `robust_sigmas` standard deviations
    lose their weight.
    """

    min_points: float
    max_thickness_m: float
    map_variance: float
    robust_sigmas: float


class MapPoints(NamedTuple):
    """End points of beams, all in the axes of the map.

    `arms` `(n, 2)` lead from the robot's position to the points, `directions` `(n, 2)` are the beams' unit vectors, and
    `variances` `(n, 2)` (m^2) are those along and across the beams.
    """

    arms: Floats
    directions: Floats
    variances: Floats


class StopPoints(NamedTuple):
    """End points of the beams of several stops: stop index `(n,)`, position `(n, 2)` (m), reliability `(n,)`, and the beams."""

    stop: Ints
    positions: Floats
    bel: Floats
    beams: MapPoints


class PoseEquations(NamedTuple):
    """Normal equations of one pose: `hessian` `(3, 3)`, `gradient` `(3,)`, and the number of points that lie on a wall."""

    hessian: Floats
    gradient: Floats
    on_walls: int


class WallEquations(NamedTuple):
    """Normal equations of s poses and w walls.

    `pose_blocks` `(s, 3, 3)` with `pose_gradients` `(s, 3)`; `wall_blocks` `(w, 3)` (offset-offset, offset-tilt, tilt-tilt) with
    `wall_gradients` `(w, 2)`; and one mixed block `(2, 3)` for each of the m pairs of a wall and a stop that sees it, wall by
    wall: `stops_of_wall` `(w,)` counts the pairs, `pair_stops` and `pair_blocks` `(m, 2, 3)` belong to the pairs.
    """

    pose_blocks: Floats
    pose_gradients: Floats
    wall_blocks: Floats
    wall_gradients: Floats
    stops_of_wall: Ints
    pair_stops: Ints
    pair_blocks: Floats


@compiled
def pooled_sums(values: Floats, cells: Ints, radius: int) -> Floats:
    """Sums `(n, k)` of `values` `(rows, cols, k)` over windows of `radius` cells around `cells` `(n, 2)`, also outside."""
    rows, cols, channels = values.shape
    sums = np.zeros((cells.shape[0], channels))
    for n in range(cells.shape[0]):
        for row in range(max(cells[n, 0] - radius, 0), min(cells[n, 0] + radius + 1, rows)):
            for col in range(max(cells[n, 1] - radius, 0), min(cells[n, 1] + radius + 1, cols)):
                for k in range(channels):
                    sums[n, k] += values[row, col, k]
    return sums


@compiled
def _line(
    moments: Floats, min_points: float, max_thickness_m: float
) -> tuple[bool, float, float, float, float]:
    """Whether moments `(7,)` are a wall segment, its centre of gravity (x, y), and its unit normal (x, y)."""
    if moments[COUNT] < min_points or moments[W] <= 0.0:
        return False, 0.0, 0.0, 0.0, 0.0
    x, y = moments[WX] / moments[W], moments[WY] / moments[W]
    xx, xy = moments[WXX] / moments[W] - x * x, moments[WXY] / moments[W] - x * y
    yy = moments[WYY] / moments[W] - y * y
    half, root = 0.5 * (xx + yy), math.hypot(0.5 * (xx - yy), xy)
    across, along = math.sqrt(max(half - root, 0.0)), math.sqrt(max(half + root, 0.0))
    angle = 0.5 * math.atan2(2.0 * xy, xx - yy)  # of the direction along the line
    is_wall = across < max_thickness_m and along > 2.0 * across
    return is_wall, x, y, -math.sin(angle), math.cos(angle)


@compiled
def _collect_moments(moments: Floats, members: Ints, positions: Floats, weights: Floats) -> None:
    """Set `moments` `(7,)` to those of the `members` `(k,)` of all points `(n, 2)` with weights `(n,)`."""
    moments[:] = 0.0
    for k in members:
        w, x, y = weights[k], positions[k, 0], positions[k, 1]
        moments[COUNT] += 1.0
        moments[W] += w
        moments[WX] += w * x
        moments[WY] += w * y
        moments[WXX] += w * x * x
        moments[WXY] += w * x * y
        moments[WYY] += w * y * y


@compiled
def _pool(pooled: Floats, moments: Floats, row: int, col: int) -> None:
    """Set `pooled` `(7,)` to the sum of `moments` `(rows, cols, 7)` over the 3 x 3 cells around a cell."""
    pooled[:] = 0.0
    for i in range(max(row - 1, 0), min(row + 2, moments.shape[0])):
        for j in range(max(col - 1, 0), min(col + 2, moments.shape[1])):
            for k in range(MOMENTS):
                pooled[k] += moments[i, j, k]


@compiled
def _weight(distance: float, variance: float, robust_sigmas: float) -> float:
    """Inverse variance, reduced for distant points (Geman and McClure)."""
    return 1.0 / variance / (1.0 + distance * distance / variance / (robust_sigmas * robust_sigmas)) ** 2


@compiled
def equations_on_lines(
    moments: Floats, cells: Ints, beams: MapPoints, position: Floats, criteria: WallCriteria
) -> PoseEquations:
    """Normal equations of the pose of a robot at `position` `(2,)` whose points lie on the walls of the map.

    `moments` `(rows, cols, 7)` are the map's. `cells` `(n, 2)` are those of the points; the line of a point is that of the
    3 x 3 cells around it.
    """
    arms, directions, variances = beams.arms, beams.directions, beams.variances
    hessian, gradient, on_walls = np.zeros((3, 3)), np.zeros(3), 0
    pooled, jacobian = np.empty(7), np.empty(3)
    for n in range(cells.shape[0]):
        _pool(pooled, moments, cells[n, 0], cells[n, 1])
        is_wall, x, y, nx, ny = _line(pooled, criteria.min_points, criteria.max_thickness_m)
        if not is_wall:
            continue
        distance = (position[0] + arms[n, 0] - x) * nx + (position[1] + arms[n, 1] - y) * ny
        radial = (nx * directions[n, 0] + ny * directions[n, 1]) ** 2
        variance = radial * variances[n, 0] + (1.0 - radial) * variances[n, 1] + criteria.map_variance
        weight = _weight(distance, variance, criteria.robust_sigmas)
        on_walls += distance * distance < ON_WALL_SQUARED * variance
        jacobian[0], jacobian[1], jacobian[2] = nx, ny, ny * arms[n, 0] - nx * arms[n, 1]
        for i in range(3):
            gradient[i] += weight * jacobian[i] * distance
            for j in range(3):
                hessian[i, j] += weight * jacobian[i] * jacobian[j]
    return PoseEquations(hessian, gradient, on_walls)


@compiled
def equations_of_walls(
    first: Ints, order: Ints, points: StopPoints, stops: int, criteria: WallCriteria
) -> WallEquations:
    """Normal equations of the residuals n (p - c) - d - a * along: poses of all stops, offset d and tilt a of each wall.

    Wall w has the points `order[first[w]:first[w + 1]]`, sorted by stop in ascending order. A point weighs its `bel`.
    """
    stop, positions, bel = points.stop, points.positions, points.bel
    arms, directions, variances = points.beams.arms, points.beams.directions, points.beams.variances
    walls, max_pairs = first.shape[0] - 1, order.shape[0]
    pose_blocks, pose_gradients = np.zeros((stops, 3, 3)), np.zeros((stops, 3))
    wall_blocks, wall_gradients = np.zeros((walls, 3)), np.zeros((walls, 2))
    pair_blocks, pair_stops = np.zeros((max_pairs, 2, 3)), np.zeros(max_pairs, np.int64)
    stops_of_wall = np.zeros(walls, np.int64)
    moments, jacobian, pair, weights = np.empty(7), np.empty(3), -1, bel / variances[:, 0]
    for wall in range(walls):
        members = order[first[wall] : first[wall + 1]]
        _collect_moments(moments, members, positions, weights)
        is_wall, x, y, nx, ny = _line(moments, criteria.min_points, criteria.max_thickness_m)
        if not is_wall:
            continue
        last = -1
        for k in members:
            s = stop[k]
            if s != last:
                pair, last = pair + 1, s
                pair_stops[pair] = s
                stops_of_wall[wall] += 1
            dx, dy = positions[k, 0] - x, positions[k, 1] - y
            distance, along = dx * nx + dy * ny, dx * ny - dy * nx
            radial = (nx * directions[k, 0] + ny * directions[k, 1]) ** 2
            variance = radial * variances[k, 0] + (1.0 - radial) * variances[k, 1] + criteria.map_variance
            weight = 0.5 * bel[k] * _weight(distance, variance, criteria.robust_sigmas)
            jacobian[0], jacobian[1], jacobian[2] = nx, ny, ny * arms[k, 0] - nx * arms[k, 1]
            for i in range(3):
                pose_gradients[s, i] += weight * jacobian[i] * distance
                pair_blocks[pair, 0, i] += weight * jacobian[i]
                pair_blocks[pair, 1, i] += weight * jacobian[i] * along
                for j in range(3):
                    pose_blocks[s, i, j] += weight * jacobian[i] * jacobian[j]
            wall_blocks[wall, 0] += weight
            wall_blocks[wall, 1] += weight * along
            wall_blocks[wall, 2] += weight * along * along
            wall_gradients[wall, 0] += weight * distance
            wall_gradients[wall, 1] += weight * along * distance
    pairs = pair + 1
    return WallEquations(
        pose_blocks=pose_blocks,
        pose_gradients=pose_gradients,
        wall_blocks=wall_blocks,
        wall_gradients=wall_gradients,
        stops_of_wall=stops_of_wall,
        pair_stops=pair_stops[:pairs],
        pair_blocks=pair_blocks[:pairs],
    )
