"""Readable reference implementations of the wall_lines kernels, with numpy and dense matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.infrared.wall_lines import MapPoints, StopPoints, WallCriteria

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]


def pooled_sums(values: Floats, cells: Cells, radius: int) -> Floats:
    """Sums over the window around each cell, cut at the borders."""
    padded = np.pad(values, ((50, 50), (50, 50), (0, 0)))
    sums = []
    for row, col in cells + 50:
        sums.append(padded[row - radius : row + radius + 1, col - radius : col + radius + 1].sum(axis=(0, 1)))
    return np.array(sums)


def line(points: Floats, weights: Floats, criteria: WallCriteria) -> tuple[Floats, Floats] | None:
    """Centre and unit normal of the line through points `(n, 2)`: the eigenvector of the smallest eigenvalue of their covariance.

    None if they are not a wall segment.
    """
    if len(points) < criteria.min_points:
        return None
    centre = np.average(points, axis=0, weights=weights)
    across, along = np.linalg.eigh(np.cov(points.T, ddof=0, aweights=weights))
    std = np.sqrt(np.maximum(across, 0.0))
    if std[0] >= criteria.max_thickness_m or std[1] <= 2.0 * std[0]:
        return None
    return centre, along[:, 0]


def weight(distance: float, variance: float, robust_sigmas: float) -> float:
    """Geman-McClure weight divided by the variance."""
    return 1.0 / variance / (1.0 + distance**2 / variance / robust_sigmas**2) ** 2


def variance_along(normal: Floats, direction: Floats, variances: Floats) -> float:
    """Variance of a point along a normal; `variances` are those along and across its beam."""
    radial = float(normal @ direction) ** 2
    return float(radial * variances[0] + (1.0 - radial) * variances[1])


def pose_jacobian(normal: Floats, arm: Floats) -> Floats:
    """Derivative of a point's distance from a line by the pose (x, y, yaw) of the robot."""
    return np.array([normal[0], normal[1], normal[1] * arm[0] - normal[0] * arm[1]])


def equations_on_lines(
    mapped: Floats, weights: Floats, cell_m: float, position: Floats, beams: MapPoints, criteria: WallCriteria
) -> tuple[Floats, Floats, int]:
    """Hessian, gradient and number of points on walls for one pose; lines are fitted to the mapped points of 3 x 3 cells."""
    hessian, gradient, on_walls = np.zeros((3, 3)), np.zeros(3), 0
    points = position + beams.arms
    mapped_cells, cells = (np.floor(p[:, ::-1] / cell_m).astype(np.int64) for p in (mapped, points))
    for k, cell in enumerate(cells):
        is_near = (np.abs(mapped_cells - cell) <= 1).all(axis=1)
        found = line(mapped[is_near], weights[is_near], criteria)
        if found is None:
            continue
        centre, normal = found
        distance = float((points[k] - centre) @ normal)
        variance = variance_along(normal, beams.directions[k], beams.variances[k]) + criteria.map_variance
        J, w = pose_jacobian(normal, beams.arms[k]), weight(distance, variance, criteria.robust_sigmas)
        hessian, gradient = hessian + w * np.outer(J, J), gradient + w * J * distance
        on_walls += distance**2 < 9.0 * variance
    return hessian, gradient, on_walls


def rows_of_walls(
    first: Cells, order: Cells, points: StopPoints, stops: int, criteria: WallCriteria
) -> tuple[Floats, Floats, Floats]:
    """The whole problem: a row of J, a residual and a weight for each point, over all poses and all walls' offsets and tilts."""
    n, walls, beams = len(points.positions), len(first) - 1, points.beams
    J, distance, weights = np.zeros((n, 3 * stops + 2 * walls)), np.zeros(n), np.zeros(n)
    for wall in range(walls):
        members = order[first[wall] : first[wall + 1]]
        found = line(points.positions[members], points.bel[members] / beams.variances[members, 0], criteria)
        if found is None:
            continue
        centre, normal = found
        for k in members:
            distance[k] = (points.positions[k] - centre) @ normal
            along = (points.positions[k] - centre) @ np.array([normal[1], -normal[0]])
            variance = variance_along(normal, beams.directions[k], beams.variances[k]) + criteria.map_variance
            weights[k] = 0.5 * points.bel[k] * weight(distance[k], variance, criteria.robust_sigmas)
            J[k, 3 * points.stop[k] : 3 * points.stop[k] + 3] = pose_jacobian(normal, beams.arms[k])
            J[k, 3 * stops + 2 * wall : 3 * stops + 2 * wall + 2] = -1.0, -along
    return J, distance, weights
