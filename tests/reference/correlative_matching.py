"""Correlative matching by trying every pose of the window."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def correlate(
    field: NDArray[np.uint8],
    origin_xy_m: NDArray[np.float64],
    resolution_m: float,
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    window_m: float,
    yaw_step_rad: float,
    yaw_steps: int,
) -> float:
    """The highest mean of the field under the points, over all whole-cell offsets and multiples of the yaw step."""
    window = int(np.ceil(window_m / resolution_m))
    best = -1.0
    for k in range(-yaw_steps, yaw_steps + 1):
        yaw = start[2] + k * yaw_step_rad
        rotation = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        cells = np.floor((points @ rotation.T + start[:2] - origin_xy_m) / resolution_m).astype(int)
        for dr in range(-window, window + 1):
            for dc in range(-window, window + 1):
                rows, cols = cells[:, 1] + dr, cells[:, 0] + dc
                inside = (rows >= 0) & (rows < field.shape[0]) & (cols >= 0) & (cols < field.shape[1])
                best = max(best, float(field[rows[inside], cols[inside]].astype(int).sum()) / len(points))
    return best


def field_level(field: NDArray[np.uint8], level: int) -> NDArray[np.uint8]:
    """At every cell the maximum of the field over the 2^level x 2^level cells from there on."""
    size = 1 << level
    padded = np.pad(field, ((0, size), (0, size)))
    rows, cols = field.shape
    shifts = [padded[r : r + rows, c : c + cols] for r in range(size) for c in range(size)]
    return np.asarray(np.max(shifts, axis=0))
