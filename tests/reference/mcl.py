"""Particle filter steps written for the eye."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tests.reference.ray_traversal import cast_cell_by_cell


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


def sum_over_beams(
    occupied: NDArray[np.bool_],
    table: NDArray[np.float32],
    cells_per_bin: float,
    bearings: Sequence[float],
    measured_bins: Sequence[int],
    sensor: Sequence[float],
    pose: Sequence[float],
    reach: float,
) -> float:
    """Sum of table[measured bin, expected bin] over the beams, the expected ranges cast cell by cell."""
    x, y, yaw = pose
    sx = x + math.cos(yaw) * sensor[0] - math.sin(yaw) * sensor[1]
    sy = y + math.sin(yaw) * sensor[0] + math.cos(yaw) * sensor[1]
    total = 0.0
    for bearing, row in zip(bearings, measured_bins, strict=True):
        expected, _ = cast_cell_by_cell(occupied, sx, sy, yaw + sensor[2] + bearing, reach)
        total += float(table[row, min(int(expected / cells_per_bin + 0.5), table.shape[1] - 1)])
    return total


def sum_over_segments(
    field: NDArray[np.uint8],
    occupied: NDArray[np.bool_],
    table: NDArray[np.float32],
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    tolerance: float,
    pose: Sequence[float],
) -> float:
    """As `sum_over_points` for the ends of beams; one with a wall on its way takes the table's last entry."""
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    total = 0.0
    for start, end in zip(starts @ turn.T + (x, y), ends @ turn.T + (x, y), strict=True):
        way = math.hypot(*(end - start)) - tolerance
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        row, col = math.floor(end[1]), math.floor(end[0])
        inside = 0 <= row < field.shape[0] and 0 <= col < field.shape[1]
        free = way <= 0.0 or cast_cell_by_cell(occupied, start[0], start[1], angle, way)[0] >= way
        total += float(table[field[row, col] if inside and free else 255])
    return total
