"""Likelihood of scan points on a hand-drawn map whose scale is unknown and may differ along x and y."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import run_in_ranges


def sum_over_stretched_points(
    field: NDArray[np.float32],
    resolution_m: float,
    table: NDArray[np.float32],
    entries_per_m: float,
    points: NDArray[np.float64],
    states: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sums `(n,)` of table values over the points `(m, 2)` of a scan, for robots in states `(n, 5)`.

    A state is x, y (drawing units), yaw, and the logarithms of the scales along the drawing's axes (drawing units per metre).
    `field` `(rows, cols)` is the distance to the nearest drawn wall (drawing units), with cells of `resolution_m`. A point's
    distance is converted to metres of the world by the mean scale; times `entries_per_m` it is the index into the table. The
    last entry holds for larger distances and for points outside the drawing.
    """
    n = states.shape[0]
    sums = np.empty(n)
    run_in_ranges(
        _sum_over_stretched_points, n, (field, resolution_m, table, entries_per_m, points, states, sums)
    )
    return sums


@compiled
def _sum_over_stretched_points(
    begin: int,
    end: int,
    field: NDArray[np.float32],
    resolution_m: float,
    table: NDArray[np.float32],
    entries_per_m: float,
    points: NDArray[np.float64],
    states: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `sum_over_stretched_points`."""
    rows, cols = field.shape
    m = points.shape[0]
    last = table.shape[0] - 1
    beyond = table[last]
    for i in range(begin, end):
        scale_x, scale_y = np.exp(states[i, 3]), np.exp(states[i, 4])
        c, s = np.cos(states[i, 2]), np.sin(states[i, 2])
        xx, xy = c * scale_x / resolution_m, -s * scale_x / resolution_m
        yx, yy = s * scale_y / resolution_m, c * scale_y / resolution_m
        # One cell is added before truncation, which then is the floor for all that lies inside.
        x, y = states[i, 0] / resolution_m + 1.0, states[i, 1] / resolution_m + 1.0
        per_unit = entries_per_m / np.sqrt(scale_x * scale_y)
        total = 0.0
        for k in range(m):
            px, py = points[k, 0], points[k, 1]
            col = int(x + xx * px + xy * py) - 1
            row = int(y + yx * px + yy * py) - 1
            if 0 <= col < cols and 0 <= row < rows:
                entry = int(field[row, col] * per_unit + 0.5)
                total += table[entry] if entry < last else beyond
            else:
                total += beyond
        sums[i] = total


def crossed_segments(
    walls: NDArray[np.bool_], resolution_m: float, starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether the segments between `starts` and `ends` `(n, 2)` (drawing units) pass a wall, `(n,)`.

    `walls` `(rows, cols)` has cells of `resolution_m`; the segments are sampled at three quarters of a cell.
    """
    crossed = np.zeros(len(starts), np.bool_)
    _crossed_segments(walls, resolution_m, starts, ends, crossed)
    return crossed


@compiled
def _crossed_segments(
    walls: NDArray[np.bool_],
    resolution_m: float,
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    crossed: NDArray[np.bool_],
) -> None:
    """Fill in the results of `crossed_segments`."""
    rows, cols = walls.shape
    for i in range(len(starts)):
        x, y = starts[i, 0] / resolution_m, starts[i, 1] / resolution_m
        dx, dy = ends[i, 0] / resolution_m - x, ends[i, 1] / resolution_m - y
        count = int(np.sqrt(dx * dx + dy * dy) / 0.75) + 1
        for k in range(count + 1):
            col, row = int(np.floor(x + dx * k / count)), int(np.floor(y + dy * k / count))
            if 0 <= col < cols and 0 <= row < rows and walls[row, col]:
                crossed[i] = True
                break
