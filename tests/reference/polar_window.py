"""Grids to rays and rays to cells, one ray and one cell at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def priors_of_ray(
    log_odds: Floats, eye: Floats, angle: float, first: float, count: int, prior: float, correlation: float
) -> tuple[list[float], list[float]]:
    """P(E) of the cells that a ray meets, and from the second on the correlation of each with the one before it."""
    cells = [
        (
            math.floor(eye[1] + (first + k) * math.sin(angle)),
            math.floor(eye[0] + (first + k) * math.cos(angle)),
        )
        for k in range(count)
    ]
    priors = [1.0 / (1.0 + math.exp(-(log_odds[cell] + prior))) for cell in cells]
    return priors, [correlation ** math.dist(*cells[k - 1 : k + 1]) for k in range(1, count)]


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
    """Every cell has the value of the nearest ray at its range, `rest` where none is near."""
    window = np.empty((len(rest), rows, cols))
    for row in range(rows):
        for col in range(cols):
            x, y = corner[0] + col, corner[1] + row
            k = math.floor(math.hypot(x, y) - first)
            off = np.abs(bearings - math.atan2(y, x))
            is_met = 0 <= k < polar.shape[2] and off.min() <= reach_rad
            window[:, row, col] = polar[:, off.argmin(), k] if is_met else rest
    return window


def averaged_over_turns(
    polar: Floats,
    rest: Floats,
    bearings: Floats,
    reach_rad: float,
    turns: Floats,
    weights: Floats,
    angles: Floats,
) -> Floats:
    """At every angle the mean over the turned rays, `rest` for those that do not come near."""
    mean = np.zeros((len(rest), len(angles), polar.shape[2]))
    for a, angle in enumerate(angles):
        for turn, weight in zip(turns, weights, strict=True):
            off = np.abs(bearings + turn - angle)
            mean[:, a] += weight * (polar[:, off.argmin()] if off.min() <= reach_rad else rest[:, None])
    return mean
