"""Sparse symmetric positive definite matrices of 5 x 5 blocks; the positions of the blocks are known before their values."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import reverse_cuthill_mckee

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIZE = 5  # rows and columns of a block: the state of a place


class BlockMatrix:
    """A matrix `(5 p, 5 p)` of the states of p places, with blocks at the (row, column) pairs of places `(k, 2)`.

    A pair may occur more than once: its blocks are added. Blocks off the diagonal must be given at (i, j) and at (j, i),
    because only the lower triangle after renumbering is used. Places are renumbered so that blocks lie near the diagonal
    (reverse Cuthill-McKee), which works well because a drive is a chain of places with few loops.
    """

    def __init__(self, places: int, blocks: Ints) -> None:
        pattern = coo_matrix((np.ones(len(blocks)), blocks.T), shape=(places, places)).tocsr()
        order = reverse_cuthill_mckee(pattern, symmetric_mode=True)
        new_index = np.empty(places, np.int64)
        new_index[order] = np.arange(places)
        within_block = np.arange(SIZE)
        self._order = (SIZE * order[:, None] + within_block).ravel()
        rows, cols = (SIZE * new_index[ends][:, None] + within_block for ends in blocks.T)
        diagonal = rows[:, :, None] - cols[:, None, :]  # 0: the main one; positive below it
        self._lower = diagonal >= 0
        self._shape = (int(diagonal.max()) + 1, SIZE * places)
        slots = diagonal * self._shape[1] + cols[:, None, :]
        self._slots = slots[self._lower]

    def solve(self, values: Floats, rhs: Floats) -> Floats:
        """The solution `(5 p,)` for the blocks' values `(k, 5, 5)` and a right-hand side `(5 p,)`.

        Raises LinAlgError if the matrix is not positive definite.
        """
        bands = np.bincount(self._slots, values[self._lower], self._shape[0] * self._shape[1])
        solution = np.empty_like(rhs)
        solution[self._order] = solveh_banded(
            bands.reshape(self._shape), rhs[self._order], overwrite_ab=True, lower=True, check_finite=False
        )
        return solution
