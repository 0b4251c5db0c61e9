"""Rows of one array within another."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def rows_in_order(subset: NDArray[np.float64], all_rows: NDArray[np.float64]) -> NDArray[np.int64]:
    """The rows `(k,)` of the second array `(n, 2)` that are those of the first `(m, 2)`, in their order.

    k < m: the row k of the first one does not follow in the second. A row that occurs again is taken where it comes first.
    """
    rows = np.empty(subset.shape[0], np.int64)
    k = 0
    for row in range(all_rows.shape[0]):
        if k == subset.shape[0]:
            break
        if all_rows[row, 0] == subset[k, 0] and all_rows[row, 1] == subset[k, 1]:
            rows[k] = row
            k += 1
    return rows[:k]
