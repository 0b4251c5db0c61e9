"""Sparse symmetric matrices of 5 x 5 blocks, whose places are known before their values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIZE = 5  # of a block: a place's state


class BlockMatrix:
    """A matrix `(5 p, 5 p)` with blocks at rows and columns `(k, 2)`; a place may be named more than once.

    The places are renumbered so that all blocks lie near the diagonal: a drive is a line with few loops.
    """

    def __init__(self, places: int, blocks: Ints) -> None:
        pattern = coo_matrix((np.ones(len(blocks)), blocks.T), shape=(places, places)).tocsr()
        order = reverse_cuthill_mckee(pattern, symmetric_mode=True)
        number = np.empty(places, np.int64)
        number[order] = np.arange(places)
        at = np.arange(SIZE)
        self._order = (SIZE * order[:, None] + at).ravel()
        rows, cols = (SIZE * number[ends][:, None] + at for ends in blocks.T)
        below = rows[:, :, None] - cols[:, None, :]
        self._lower = below >= 0
        self._shape = (int(below.max()) + 1, SIZE * places)
        slots = below * self._shape[1] + cols[:, None, :]
        self._slots = slots[self._lower]

    def solve(self, values: Floats, right: Floats) -> Floats:
        """The solution `(5 p,)` of the matrix with blocks of these values `(k, 5, 5)`, summed where they share a place."""
        bands = np.bincount(self._slots, values[self._lower], self._shape[0] * self._shape[1])
        solution = np.empty_like(right)
        solution[self._order] = solveh_banded(
            bands.reshape(self._shape), right[self._order], overwrite_ab=True, lower=True, check_finite=False
        )
        return solution
