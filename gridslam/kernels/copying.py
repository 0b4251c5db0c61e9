"""Copies of parts of arrays, element by element.

An assignment to a slice does the same, but brings numba's checks of shapes with it, which take seconds to compile.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def copy_row(target: NDArray[Any], row: int, source: NDArray[Any]) -> None:
    """Set target[row] `(n,)` to the source `(n,)`."""
    for i in range(source.shape[0]):
        target[row, i] = source[i]


@compiled
def copy_square(target: NDArray[Any], source: NDArray[Any], size: int) -> None:
    """Set the first `size` rows and columns of the target to those of the source."""
    for i in range(size):
        for j in range(size):
            target[i, j] = source[i, j]
