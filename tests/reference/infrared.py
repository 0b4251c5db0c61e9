"""Readable reference implementations of the ir-scan kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tests.reference.log_odds import crossed_cells

Floats = NDArray[np.float64]
Cells = NDArray[np.int64]


def bresenham(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """The cells from start to end: steps of one cell along the longer side, the other side rounded to the nearest cell."""
    (r0, c0), (r1, c1) = start, end
    steps = max(abs(r1 - r0), abs(c1 - c0))
    if not steps:
        return [start]
    return [(_rounded(r0, r1 - r0, k, steps), _rounded(c0, c1 - c0, k, steps)) for k in range(steps + 1)]


def _rounded(first: int, difference: int, k: int, steps: int) -> int:
    if abs(difference) == steps:
        return first + (k if difference > 0 else -k)
    return first + round(k / steps * difference)


def add_reading(pos: Floats, start: tuple[int, int], end: tuple[int, int], bel: float) -> None:
    """pos += bel IR(r), IR = -1 + (r/R)^2 before the reading's cell and 1 in it."""
    R = np.hypot(end[0] - start[0], end[1] - start[1])
    for cell in bresenham(start, end)[:-1]:
        r = np.hypot(cell[0] - start[0], cell[1] - start[1])
        pos[cell] += bel * (-1.0 + (r / R) ** 2)
    pos[end] += bel


def shifted_sums(values: Floats, cells: Cells, max_shift: int) -> Floats:
    """For every shift, the sum of the values under the shifted cells inside the grid."""
    size = 2 * max_shift + 1
    sums = np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            for row, col in cells:
                r, c = row + i - max_shift, col + j - max_shift
                if 0 <= r < values.shape[0] and 0 <= c < values.shape[1]:
                    sums[i, j] += values[r, c]
    return sums


def shifted_changes(values: Floats, cells: Cells, max_shift: int, row_shift: int, col_shift: int) -> Floats:
    """For every shift, the sum of the squared changes of the value under each cell from the given shift to it."""

    def under(row: int, col: int) -> float:
        inside = 0 <= row < values.shape[0] and 0 <= col < values.shape[1]
        return float(values[row, col]) if inside else 0.0

    size = 2 * max_shift + 1
    squares = np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            for row, col in cells:
                here = under(row + row_shift, col + col_shift)
                squares[i, j] += (here - under(row + i - max_shift, col + j - max_shift)) ** 2
    return squares


def count_crossed(crossed: Floats, origins: Floats, endpoints: Floats) -> None:
    """crossed += 1 for all cells that each line passes, found by its intersections with all grid lines."""
    for start, end in zip(origins.tolist(), endpoints.tolist(), strict=True):
        for row, col in [*crossed_cells(*start, *end), (int(end[1] // 1), int(end[0] // 1))]:
            if 0 <= row < crossed.shape[0] and 0 <= col < crossed.shape[1]:
                crossed[row, col] += 1.0


def splat_maximum(values: Floats, cells: Cells, kernel: Floats, weights: Floats) -> None:
    """values = max(values, weight * kernel) around each cell."""
    radius = len(kernel) // 2
    padded = np.pad(values, radius + int(np.abs(cells).max()) + 1)
    corner = (len(padded) - len(values)) // 2 - radius
    for (row, col), weight in zip(cells + corner, weights, strict=True):
        under = padded[row : row + len(kernel), col : col + len(kernel)]
        np.maximum(under, weight * kernel, out=under)
    inner = corner + radius
    values[:] = padded[inner : inner + values.shape[0], inner : inner + values.shape[1]]
