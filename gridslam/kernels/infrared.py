"""Beams of infrared rangers into grids, and sums of grid values under shifted end points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grid_traversal import advance, start_traversal, steps_to


@compiled
def add_readings(
    pos: NDArray[np.float64],
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    bel: NDArray[np.float64],
) -> None:
    """pos += bel_k IR(r) for the cells from sensor to reading (ir-scan, paper section 2.7 and 2.8), by Bresenham.

    `starts` and `ends` `(n, 2)` are cells (row, col) inside of `pos` (rows, cols). IR(r) = -1 + (r/R)^2 before the reading
    and 1 in its cell; r and R are distances between the centres of cells.
    """
    for k in range(starts.shape[0]):
        row, col = starts[k, 0], starts[k, 1]
        end_row, end_col = ends[k, 0], ends[k, 1]
        rows, cols = abs(end_row - row), abs(end_col - col)
        step_row, step_col = (1 if end_row > row else -1), (1 if end_col > col else -1)
        start_row, start_col = row, col
        whole = float(rows * rows + cols * cols)
        error = cols - rows
        while row != end_row or col != end_col:
            way = float((row - start_row) ** 2 + (col - start_col) ** 2)
            pos[row, col] += bel[k] * (way / whole - 1.0)
            twice = 2 * error
            if twice > -rows:
                error -= rows
                col += step_col
            if twice < cols:
                error += cols
                row += step_row
        pos[end_row, end_col] += bel[k]


@compiled
def shifted_sums(values: NDArray[np.float64], cells: NDArray[np.int64], reach: int) -> NDArray[np.float64]:
    """match_ij = sum_k values[row_k + i, col_k + j] for i, j in -reach..reach (ir-scan, paper section 2.6).

    `cells` `(n, 2)` are (row, col) and may lie outside of `values` (rows, cols), where the sum gets nothing.
    """
    rows, cols = values.shape
    size = 2 * reach + 1
    sums = np.zeros((size, size))
    for k in range(cells.shape[0]):
        first_row, first_col = cells[k, 0] - reach, cells[k, 1] - reach
        low_j, high_j = max(0, -first_col), min(size, cols - first_col)
        for i in range(max(0, -first_row), min(size, rows - first_row)):
            under = values[
                first_row + i, first_col + low_j : first_col + high_j
            ]  # views: indices from 0 run as vectors
            into = sums[i, low_j:high_j]
            for j in range(into.size):
                into[j] += under[j]
    return sums


@compiled
def shifted_changes(
    values: NDArray[np.float64], cells: NDArray[np.int64], reach: int, row_shift: int, col_shift: int
) -> NDArray[np.float64]:
    """sum_k (values under point k at the given shift - values under it at shift i, j)^2 for i, j in -reach..reach.

    `cells` as in `shifted_sums`; 0 outside of `values`. The root is the standard error of the difference of both
    shifts' sums, if points err independently.
    """
    rows, cols = values.shape
    size = 2 * reach + 1
    squares = np.zeros((size, size))
    for k in range(cells.shape[0]):
        row, col = cells[k, 0] + row_shift, cells[k, 1] + col_shift
        here = values[row, col] if 0 <= row < rows and 0 <= col < cols else 0.0
        for i in range(size):
            row = cells[k, 0] + i - reach
            inside = 0 <= row < rows
            for j in range(size):
                col = cells[k, 1] + j - reach
                there = values[row, col] if inside and 0 <= col < cols else 0.0
                squares[i, j] += (here - there) ** 2
    return squares


@compiled
def add_spots(
    values: NDArray[np.float64],
    cells: NDArray[np.int64],
    spot: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> None:
    """Raise `values` (rows, cols) about each cell `(n, 2)` to weight times a spot (2r+1, 2r+1) where they are lower."""
    reach = spot.shape[0] // 2
    rows, cols = values.shape
    for k in range(cells.shape[0]):
        for i in range(-reach, reach + 1):
            row = cells[k, 0] + i
            if row < 0 or row >= rows:
                continue
            for j in range(-reach, reach + 1):
                col = cells[k, 1] + j
                if 0 <= col < cols:
                    level = weights[k] * spot[i + reach, j + reach]
                    if level > values[row, col]:
                        values[row, col] = level


@compiled
def count_crossed(
    crossed: NDArray[np.float64], starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> None:
    """Add 1 to all cells of `crossed` (rows, cols) that the lines from `starts` to `ends` `(n, 2)` pass, by exact traversal.

    Both are x, y in cells from the grid's corner (see `grid_traversal`).
    """
    rows, cols = crossed.shape
    for k in range(starts.shape[0]):
        line = start_traversal(starts[k, 0], starts[k, 1], ends[k, 0], ends[k, 1])
        end_row, end_col = int(np.floor(ends[k, 1])), int(np.floor(ends[k, 0]))
        for _ in range(steps_to(line, end_row, end_col) + 1):
            if 0 <= line.row < rows and 0 <= line.col < cols:
                crossed[line.row, line.col] += 1.0
            line = advance(line)
