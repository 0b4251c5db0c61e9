"""Reference implementations of the particle filter's kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.localization.beam import MeasuredBeams, RangeTable
from gridslam.kernels.localization.likelihood_field import BeamCells
from tests.reference.ray_traversal import cast_cell_by_cell


def sum_over_points(
    field: NDArray[np.uint8],
    table: NDArray[np.float32],
    points: NDArray[np.float64],
    pose: Sequence[float],
) -> float:
    """Sum of the table's values under the points for one pose; points outside the field take its last entry."""
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
    """Indices of the particles whose intervals of the cumulative weights contain the evenly spaced positions."""
    ends = np.cumsum(weights)
    positions = [(k + start) * ends[-1] / count for k in range(count)]
    return [
        next((i for i, end in enumerate(ends) if end > position), len(weights) - 1) for position in positions
    ]


def occupied_bins(poses: NDArray[np.float64], chosen: Sequence[int], bin_m: float, bin_rad: float) -> int:
    """Number of different bins."""
    sizes = (bin_m, bin_m, bin_rad)
    return len({tuple(math.floor(v / s) for v, s in zip(poses[i], sizes, strict=True)) for i in chosen})


def sum_over_ranges(
    occupied: NDArray[np.bool_], table: RangeTable, beams: MeasuredBeams, pose: Sequence[float]
) -> float:
    """Sum over the beams of the log-probability of measured bin and expected bin; expected ranges are cast cell by cell."""
    log_probability, cells_per_bin = table
    bearings, measured_bins, sensor, max_range = beams
    x, y, yaw = pose
    sx = x + math.cos(yaw) * sensor[0] - math.sin(yaw) * sensor[1]
    sy = y + math.sin(yaw) * sensor[0] + math.cos(yaw) * sensor[1]
    total = 0.0
    for bearing, row in zip(bearings, measured_bins, strict=True):
        expected, _ = cast_cell_by_cell(occupied, sx, sy, yaw + sensor[2] + bearing, max_range)
        total += float(
            log_probability[row, min(int(expected / cells_per_bin + 0.5), log_probability.shape[1] - 1)]
        )
    return total


def sum_over_beams(
    field: NDArray[np.uint8],
    occupied: NDArray[np.bool_],
    table: NDArray[np.float32],
    beams: BeamCells,
    tolerance: float,
    pose: Sequence[float],
) -> float:
    """As `sum_over_points` for the endpoints of beams; a blocked beam takes the table's last entry. The slack is 0."""
    x, y, yaw = pose
    rotation = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    total = 0.0
    origins, endpoints = (points @ rotation.T + (x, y) for points in beams)
    for start, end in zip(origins, endpoints, strict=True):
        length = math.hypot(*(end - start)) - tolerance
        angle = math.atan2(end[1] - start[1], end[0] - start[0])
        row, col = math.floor(end[1]), math.floor(end[0])
        inside = 0 <= row < field.shape[0] and 0 <= col < field.shape[1]
        free = length <= 0.0 or cast_cell_by_cell(occupied, start[0], start[1], angle, length)[0] >= length
        total += float(table[field[row, col] if inside and free else 255])
    return total
