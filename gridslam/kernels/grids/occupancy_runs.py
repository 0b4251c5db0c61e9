"""Lengths of runs of equal occupancy along rows, columns and diagonals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

UNKNOWN = -1


@compiled
def follow_runs(
    state: NDArray[np.int8], starts: NDArray[np.int64], steps: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Number of steps `(n,)` to the first cell of another state, and whether such a cell was met `(n,)`.

    The walks start in cells `starts` `(n, 2)` and follow `steps` `(n, 2)`, both (row, col). `state` `(rows, cols)` is 1 occupied,
    0 free, UNKNOWN. A walk is censored where the map ends or an unknown cell comes first: its length is then the number of steps
    within its own state.
    """
    n = starts.shape[0]
    rows, cols = state.shape
    length = np.zeros(n, np.int64)
    changed = np.zeros(n, np.bool_)
    for i in range(n):
        row, col = starts[i, 0], starts[i, 1]
        own = state[row, col]
        while True:
            row += steps[i, 0]
            col += steps[i, 1]
            if row < 0 or col < 0 or row >= rows or col >= cols or state[row, col] == UNKNOWN:
                break
            length[i] += 1
            if state[row, col] != own:
                changed[i] = True
                break
    return length, changed
