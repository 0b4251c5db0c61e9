"""Walks over a map until its state changes, one at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def follow_run(
    state: NDArray[np.int8], start: tuple[int, int], step: tuple[int, int], unknown: int
) -> tuple[int, bool]:
    """Number of steps to a cell of another state, and whether one was met before the map's end or an unknown cell."""
    (row, col), length = start, 0
    while True:
        row, col = row + step[0], col + step[1]
        inside = 0 <= row < state.shape[0] and 0 <= col < state.shape[1]
        if not inside or state[row, col] == unknown:
            return length, False
        length += 1
        if state[row, col] != state[start]:
            return length, True
