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
