"""Scoring of poses by the distance field under the scan's end points.

The field is a byte per cell: the distance to the nearest occupied cell in steps of the caller's choice. What a distance is worth
is a table of 256 entries, so that one field serves every model: a sharp likelihood, a broad one, a count of explained beams.
Coordinates are in cells from the field's lower-left corner; points beyond the field take the last entry of the table.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel
from gridslam.kernels.raycast import cast


@compiled_parallel
def sum_over_points(
    field: NDArray[np.uint8],
    table: NDArray[np.float32],
    points: NDArray[np.float32],
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sum of table[field] `(n,)` over the points `(m, 2)` seen from each pose `(n, 3)` (x, y in cells, yaw)."""
    rows, cols = field.shape
    n, m = poses.shape[0], points.shape[0]
    sums = np.empty(n)
    beyond = table[255]
    for i in prange(n):
        c, s = np.float32(np.cos(poses[i, 2])), np.float32(np.sin(poses[i, 2]))
        # One cell is added before truncation, which then is the floor for all that lies inside.
        x, y = np.float32(poses[i, 0] + 1.0), np.float32(poses[i, 1] + 1.0)
        total = np.float32(0.0)
        for k in range(m):
            px, py = points[k, 0], points[k, 1]
            col = np.int32(x + c * px - s * py) - 1
            row = np.int32(y + s * px + c * py) - 1
            if 0 <= col < cols and 0 <= row < rows:
                total += table[field[row, col]]
            else:
                total += beyond
        sums[i] = total
    return sums


@compiled_parallel
def sum_over_offsets(
    worth: NDArray[np.uint8], starts: NDArray[np.int32], offsets: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Scores `(h, n)` of n places under h headings: sums of the flat field `worth` at starts[i] + offsets[h, k].

    `worth` is padded so that every index lies inside; `offsets` `(h, m)` are the scan's points, turned and flattened.
    """
    headings, m = offsets.shape
    n = starts.shape[0]
    scores = np.zeros((headings, n), np.int32)
    for h in prange(headings):
        for i in range(n):
            start = starts[i]
            total = np.int32(0)
            for k in range(m):
                total += worth[start + offsets[h, k]]
            scores[h, i] = total
    return scores


@compiled
def _is_blocked(
    squares: NDArray[np.uint8], x: float, y: float, dx: float, dy: float, tolerance: float, aside: float
) -> bool:
    """Whether a wall lies on the way from (x, y) by (dx, dy), moved aside at its end, up to the tolerance before the end."""
    length = np.sqrt(dx * dx + dy * dy)
    if length <= tolerance:
        return False
    dx, dy = dx - aside * dy / length, dy + aside * dx / length
    moved = np.sqrt(dx * dx + dy * dy)
    way = length - tolerance
    return bool(cast(squares, x, y, dx / moved, dy / moved, way) < way)


@compiled_parallel
def sum_over_segments(
    field: NDArray[np.uint8],
    squares: NDArray[np.uint8],
    table: NDArray[np.float32],
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    tolerance: float,
    slack: float,
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """As `sum_over_points` for the `ends` `(m, 2)` of beams; one with a blocked way from its start `(m, 2)` takes the last entry.

    Blocked is a way with a wall farther than `tolerance` (cells) before its end, that stays blocked when the end is moved aside
    by `slack` (cells) either way: a beam along a wall may graze it. `squares` are those of ray casting.
    """
    rows, cols = field.shape
    n, m = poses.shape[0], ends.shape[0]
    sums = np.empty(n)
    for i in prange(n):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        total = 0.0
        for k in range(m):
            x = poses[i, 0] + c * ends[k, 0] - s * ends[k, 1]
            y = poses[i, 1] + s * ends[k, 0] + c * ends[k, 1]
            col, row = int(np.floor(x)), int(np.floor(y))
            value = table[255]
            if 0 <= col < cols and 0 <= row < rows:
                value = table[field[row, col]]
            if value != table[255]:
                x0 = poses[i, 0] + c * starts[k, 0] - s * starts[k, 1]
                y0 = poses[i, 1] + s * starts[k, 0] + c * starts[k, 1]
                if (
                    _is_blocked(squares, x0, y0, x - x0, y - y0, tolerance, 0.0)
                    and _is_blocked(squares, x0, y0, x - x0, y - y0, tolerance, slack)
                    and _is_blocked(squares, x0, y0, x - x0, y - y0, tolerance, -slack)
                ):
                    value = table[255]
            total += value
        sums[i] = total
    return sums
