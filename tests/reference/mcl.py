"""Particle filter steps written for the eye."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def sum_over_points(
    field: NDArray[np.uint8],
    table: NDArray[np.float32],
    points: NDArray[np.float64],
    pose: Sequence[float],
) -> float:
    """Sum of the table's values under the points seen from one pose; beyond the field its last entry."""
    rows, cols = field.shape
    x, y, yaw = pose
    total = 0.0
    for px, py in points:
        col = math.floor(x + math.cos(yaw) * px - math.sin(yaw) * py)
        row = math.floor(y + math.sin(yaw) * px + math.cos(yaw) * py)
        inside = 0 <= row < rows and 0 <= col < cols
        total += float(table[field[row, col] if inside else 255])
    return total


def systematic(weights: Sequence[float], count: int, start: float) -> list[int]:
    """For each tooth of the comb, the particle whose share of the weights it points into."""
    ends = np.cumsum(weights)
    teeth = [(k + start) * ends[-1] / count for k in range(count)]
    return [next((i for i, end in enumerate(ends) if end > tooth), len(weights) - 1) for tooth in teeth]


def occupied_bins(poses: NDArray[np.float64], chosen: Sequence[int], cell_m: float, cell_rad: float) -> int:
    """Number of different bins."""
    sizes = (cell_m, cell_m, cell_rad)
    return len({tuple(math.floor(v / s) for v, s in zip(poses[i], sizes, strict=True)) for i in chosen})
