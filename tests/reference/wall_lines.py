"""The kernels of wall_lines written for the eye, by numpy and dense matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]


def pooled_sums(values: Floats, cells: Cells, reach: int) -> Floats:
    """Sums over the window about each cell, cut at the borders."""
    padded = np.pad(values, ((50, 50), (50, 50), (0, 0)))
    sums = []
    for row, col in cells + 50:
        sums.append(padded[row - reach : row + reach + 1, col - reach : col + reach + 1].sum(axis=(0, 1)))
    return np.array(sums)


def line(
    points: Floats, weights: Floats, least_points: float, thickest_m: float
) -> tuple[Floats, Floats] | None:
    """Centre and unit normal of the line through points `(n, 2)`: the eigenvector of their covariance with the least eigenvalue.

    None where they are no piece of wall.
    """
    if len(points) < least_points:
        return None
    centre = np.average(points, axis=0, weights=weights)
    across, along = np.linalg.eigh(np.cov(points.T, ddof=0, aweights=weights))
    deviations = np.sqrt(np.maximum(across, 0.0))
    if deviations[0] >= thickest_m or deviations[1] <= 2.0 * deviations[0]:
        return None
    return centre, along[:, 0]


def weight(off: float, variance: float, robust_sigmas: float) -> float:
    """Geman-McClure over the variance."""
    return 1.0 / variance / (1.0 + off**2 / variance / robust_sigmas**2) ** 2


def variance_along(normal: Floats, direction: Floats, variances: Floats) -> float:
    """Variance of a point along a normal, `variances` being those along and across its beam."""
    share = float(normal @ direction) ** 2
    return float(share * variances[0] + (1.0 - share) * variances[1])


def pose_jacobian(normal: Floats, arm: Floats) -> Floats:
    """Derivative of a point's distance from a line by the pose (x, y, yaw) of the robot."""
    return np.array([normal[0], normal[1], normal[1] * arm[0] - normal[0] * arm[1]])


def equations_on_lines(
    mapped: Floats,
    weights: Floats,
    cell_m: float,
    points: Floats,
    arms: Floats,
    directions: Floats,
    variances: Floats,
    least_points: float,
    thickest_m: float,
    map_variance: float,
    robust_sigmas: float,
) -> tuple[Floats, Floats, int]:
    """Hessian, gradient and points near walls of one pose; lines are fitted to the mapped points themselves, of 3 x 3 cells."""
    hessian, gradient, near = np.zeros((3, 3)), np.zeros(3), 0
    at, cells = (np.floor(p[:, ::-1] / cell_m).astype(np.int64) for p in (mapped, points))
    for k, cell in enumerate(cells):
        about = (np.abs(at - cell) <= 1).all(axis=1)
        found = line(mapped[about], weights[about], least_points, thickest_m)
        if found is None:
            continue
        centre, normal = found
        off = float((points[k] - centre) @ normal)
        variance = variance_along(normal, directions[k], variances[k]) + map_variance
        J, w = pose_jacobian(normal, arms[k]), weight(off, variance, robust_sigmas)
        hessian, gradient = hessian + w * np.outer(J, J), gradient + w * J * off
        near += off**2 < 9.0 * variance
    return hessian, gradient, near


def rows_of_walls(
    first: Cells,
    order: Cells,
    place: Cells,
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
) -> tuple[Floats, Floats, Floats]:
    """The whole problem: a row of J, a residual and a weight for each point, over all poses and all walls' offsets and tilts."""
    n, walls = len(points), len(first) - 1
    J, off, weights = np.zeros((n, 3 * places + 2 * walls)), np.zeros(n), np.zeros(n)
    for wall in range(walls):
        members = order[first[wall] : first[wall + 1]]
        found = line(points[members], bel[members] / variances[members, 0], least_points, thickest_m)
        if found is None:
            continue
        centre, normal = found
        for k in members:
            off[k] = (points[k] - centre) @ normal
            along = (points[k] - centre) @ np.array([normal[1], -normal[0]])
            variance = variance_along(normal, directions[k], variances[k]) + map_variance
            weights[k] = 0.5 * bel[k] * weight(off[k], variance, robust_sigmas)
            J[k, 3 * place[k] : 3 * place[k] + 3] = pose_jacobian(normal, arms[k])
            J[k, 3 * places + 2 * wall : 3 * places + 2 * wall + 2] = -1.0, -along
    return J, off, weights
