"""Points spread evenly over surfaces: near surfaces end most beams of a scan, and would count for more than all others."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def first_in_squares(points: Floats, side_m: float) -> NDArray[np.int64]:
    """Rows of the points `(m, 2)` that are the first in their square of the plane, square by square."""
    squares = np.floor(points / side_m).astype(np.int64)
    squares -= squares.min(axis=0, initial=0)
    columns = squares[:, 1].max(initial=0) + 1
    return np.asarray(np.unique(squares[:, 0] * columns + squares[:, 1], return_index=True)[1])
