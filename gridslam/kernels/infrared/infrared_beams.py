"""Infrared beams into grids, and sums of grid values under shifted end points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.grid_traversal import advance, start_traversal, steps_to


@compiled
def add_readings(
    pos: NDArray[np.float64],
    origins: NDArray[np.int64],
    endpoints: NDArray[np.int64],
    bel: NDArray[np.float64],
) -> None:
    """Add bel_k IR(r) to the cells of `pos` from each sensor to its reading (ir-scan, paper sections 2.7 and 2.8), by Bresenham.

    `origins` and `endpoints` `(n, 2)` are cells (row, col) inside `pos` `(rows, cols)`; `bel` `(n,)` is the reliability of the
    readings. IR(r) = -1 + (r/R)^2 before the reading and 1 in its cell; r and R are distances between cell centres.
    """
    for k in range(origins.shape[0]):
        row, col = origins[k, 0], origins[k, 1]
        endpoint_row, endpoint_col = endpoints[k, 0], endpoints[k, 1]
        rows, cols = abs(endpoint_row - row), abs(endpoint_col - col)
        step_row, step_col = (1 if endpoint_row > row else -1), (1 if endpoint_col > col else -1)
        first_row, first_col = row, col
        squared_range = float(rows * rows + cols * cols)
        error = cols - rows
        while row != endpoint_row or col != endpoint_col:
            squared_distance = float((row - first_row) ** 2 + (col - first_col) ** 2)
            pos[row, col] += bel[k] * (squared_distance / squared_range - 1.0)
            doubled = 2 * error
            if doubled > -rows:
                error -= rows
                col += step_col
            if doubled < cols:
                error += cols
                row += step_row
        pos[endpoint_row, endpoint_col] += bel[k]


@compiled
def shifted_sums(
    values: NDArray[np.float64], cells: NDArray[np.int64], max_shift: int
) -> NDArray[np.float64]:
    """match_ij = sum_k values[row_k + i, col_k + j] for i, j in -max_shift..max_shift (ir-scan, paper section 2.6).

    `cells` `(n, 2)` are (row, col). Cells outside `values` `(rows, cols)` add nothing.
    """
    rows, cols = values.shape
    size = 2 * max_shift + 1
    sums = np.zeros((size, size))
    for k in range(cells.shape[0]):
        first_row, first_col = cells[k, 0] - max_shift, cells[k, 1] - max_shift
        low_j, high_j = max(0, -first_col), min(size, cols - first_col)
        for i in range(max(0, -first_row), min(size, rows - first_row)):
            # Views whose indices start at 0 are vectorised.
            source = values[first_row + i, first_col + low_j : first_col + high_j]
            target = sums[i, low_j:high_j]
            for j in range(target.size):
                target[j] += source[j]
    return sums


@compiled
def shifted_changes(
    values: NDArray[np.float64], cells: NDArray[np.int64], max_shift: int, row_shift: int, col_shift: int
) -> NDArray[np.float64]:
    """Sum over k of (value under point k at the given shift - value under it at shift i, j)^2, i, j in -max_shift..max_shift.

    `cells` as in `shifted_sums`; the value outside `values` is 0. The square root is the standard error of the difference of
    both shifts' sums if the errors of the points are independent.
    """
    rows, cols = values.shape
    size = 2 * max_shift + 1
    squares = np.zeros((size, size))
    for k in range(cells.shape[0]):
        row, col = cells[k, 0] + row_shift, cells[k, 1] + col_shift
        given = values[row, col] if 0 <= row < rows and 0 <= col < cols else 0.0
        for i in range(size):
            row = cells[k, 0] + i - max_shift
            inside = 0 <= row < rows
            for j in range(size):
                col = cells[k, 1] + j - max_shift
                other = values[row, col] if inside and 0 <= col < cols else 0.0
                squares[i, j] += (given - other) ** 2
    return squares


@compiled
def splat_maximum(
    values: NDArray[np.float64],
    cells: NDArray[np.int64],
    kernel: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> None:
    """values = max(values, weight * kernel) around each of the `cells` `(n, 2)`.

    `values` `(rows, cols)` is changed in place, `kernel` `(2r+1, 2r+1)` is centred on the cell, `weights` `(n,)`.
    """
    radius = kernel.shape[0] // 2
    rows, cols = values.shape
    for k in range(cells.shape[0]):
        for i in range(-radius, radius + 1):
            row = cells[k, 0] + i
            if row < 0 or row >= rows:
                continue
            for j in range(-radius, radius + 1):
                col = cells[k, 1] + j
                if 0 <= col < cols:
                    level = weights[k] * kernel[i + radius, j + radius]
                    if level > values[row, col]:
                        values[row, col] = level


@compiled
def count_crossed(
    crossed: NDArray[np.float64], origins: NDArray[np.float64], endpoints: NDArray[np.float64]
) -> None:
    """Add 1 to every cell of `crossed` `(rows, cols)` that a line from `origins` to `endpoints` `(n, 2)` passes.

    Both are x, y in cells from the grid's corner (see `grid_traversal`).
    """
    rows, cols = crossed.shape
    for k in range(origins.shape[0]):
        line = start_traversal(origins[k, 0], origins[k, 1], endpoints[k, 0], endpoints[k, 1])
        endpoint_row, endpoint_col = int(np.floor(endpoints[k, 1])), int(np.floor(endpoints[k, 0]))
        for _ in range(steps_to(line, endpoint_row, endpoint_col) + 1):
            if 0 <= line.row < rows and 0 <= line.col < cols:
                crossed[line.row, line.col] += 1.0
            line = advance(line)
