"""Scores of poses by the beam model: a table over the measured range and the range that the map predicts."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.raycast import RAYS_EACH, Ray, cast
from gridslam.kernels.threads import run_in_ranges


class RangeTable(NamedTuple):
    """Log-probabilities `(bins, bins)` by the measured range (row) and the expected range (column).

    Bins have the width `cells_per_bin`; the last row and the last column are no return.
    """

    log_probability: NDArray[np.float32]
    cells_per_bin: float


class MeasuredBeams(NamedTuple):
    """One scan: bearings `(b,)` in the sensor's frame, bins `(b,)` of the measured ranges, and T_base_sensor `(3,)` in cells.

    `max_range` (cells) is the range at which rays end.
    """

    bearings: NDArray[np.float64]
    bins: NDArray[np.int64]
    sensor: NDArray[np.float64]
    max_range: float


def sum_over_ranges(
    boxes: NDArray[np.uint8], table: RangeTable, beams: MeasuredBeams, poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sums `(n,)` over the beams of the table's log-probabilities for robot poses `(n, 3)` (x, y in cells, yaw).

    The expected ranges are those of ray casting in the free `boxes` of the map (see `raycast`).
    """
    n = poses.shape[0]
    sums = np.empty(n)
    smallest = RAYS_EACH // max(len(beams.bearings), 1) + 1
    run_in_ranges(_sum_over_ranges, n, (boxes, table, beams, poses, sums), smallest)
    return sums


@compiled
def _sum_over_ranges(
    begin: int,
    end: int,
    boxes: NDArray[np.uint8],
    table: RangeTable,
    beams: MeasuredBeams,
    poses: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `sum_over_ranges`."""
    log_probability, bearings, sensor = table.log_probability, beams.bearings, beams.sensor
    b = bearings.shape[0]
    last = log_probability.shape[1] - 1
    cos_b, sin_b = np.cos(bearings), np.sin(bearings)
    for i in range(begin, end):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        x = poses[i, 0] + c * sensor[0] - s * sensor[1]
        y = poses[i, 1] + s * sensor[0] + c * sensor[1]
        yaw = poses[i, 2] + sensor[2]
        c, s = np.cos(yaw), np.sin(yaw)
        total = 0.0
        for k in range(b):
            dx = c * cos_b[k] - s * sin_b[k]
            dy = s * cos_b[k] + c * sin_b[k]
            expected = cast(boxes, Ray(x, y, dx, dy), beams.max_range)
            column = min(int(expected / table.cells_per_bin + 0.5), last)
            total += log_probability[beams.bins[k], column]
        sums[i] = total
