"""Grids to rays and rays to cells, one ray and one cell at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.stereo.polar_window import GridRays, PolarWindow

Floats = NDArray[np.float64]


def priors_of_ray(
    log_odds: Floats, rays: GridRays, i: int, prior_log_odds: float, correlation: float
) -> tuple[list[float], list[float]]:
    """P(E) of the cells of ray i, and from the second cell on the correlation with the cell before."""
    angle, origin = rays.angles[i], rays.origin
    cells = [
        (
            math.floor(origin[1] + (rays.first + k) * math.sin(angle)),
            math.floor(origin[0] + (rays.first + k) * math.cos(angle)),
        )
        for k in range(rays.cells)
    ]
    priors = [1.0 / (1.0 + math.exp(-(log_odds[cell] + prior_log_odds))) for cell in cells]
    return priors, [correlation ** math.dist(*cells[k - 1 : k + 1]) for k in range(1, rays.cells)]


def window_of_rays(window: PolarWindow, first: float, corner: Floats, rows: int, cols: int) -> Floats:
    """Every cell has the value of the nearest ray at its range, or the default if no ray is near."""
    cells = np.empty((len(window.default), rows, cols))
    for row in range(rows):
        for col in range(cols):
            x, y = corner[0] + col, corner[1] + row
            k = math.floor(math.hypot(x, y) - first)
            offset = np.abs(window.bearings - math.atan2(y, x))
            is_met = 0 <= k < window.values.shape[2] and offset.min() <= window.max_offset_rad
            cells[:, row, col] = window.values[:, offset.argmin(), k] if is_met else window.default
    return cells


def averaged_over_yaw(window: PolarWindow, yaw_offsets: Floats, weights: Floats, angles: Floats) -> Floats:
    """At every angle, the mean over the rotated rays; rays that are not near count with the default."""
    polar, default = window.values, window.default
    mean = np.zeros((len(default), len(angles), polar.shape[2]))
    for a, angle in enumerate(angles):
        for yaw, weight in zip(yaw_offsets, weights, strict=True):
            offset = np.abs(window.bearings + yaw - angle)
            is_near = offset.min() <= window.max_offset_rad
            mean[:, a] += weight * (polar[:, offset.argmin()] if is_near else default[:, None])
    return mean
