"""Scoring of poses by the distance field under the scan's end points.

The field is a byte per cell: the distance to the nearest occupied cell in steps of the caller's choice. What a distance is worth
is a table of 256 entries, so that one field serves every model: a sharp likelihood, a broad one, a count of explained beams.
Coordinates are in cells from the field's lower-left corner; points beyond the field take the last entry of the table.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray


@njit(cache=True, parallel=True)
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


@njit(cache=True, parallel=True)
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
