"""Reference implementation of ray casting: from cell to cell, one grid line at a time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def cast_cell_by_cell(
    occupied: NDArray[np.bool_], x: float, y: float, angle_rad: float, max_range: float
) -> tuple[float, tuple[int, int] | None]:
    """Range (cells) and the cell (row, col) that is hit; the maximum range and None if there is none."""
    rows, cols = occupied.shape
    dx, dy = math.cos(angle_rad), math.sin(angle_rad)
    row, col = math.floor(y), math.floor(x)
    travelled = 0.0
    while 0 <= row < rows and 0 <= col < cols and travelled < max_range:
        if occupied[row, col]:
            return travelled, (row, col)
        to_column = ((col + 1 if dx > 0 else col) - x) / dx if dx != 0.0 else math.inf
        to_row = ((row + 1 if dy > 0 else row) - y) / dy if dy != 0.0 else math.inf
        travelled = min(to_column, to_row)
        if to_column < to_row:
            col += 1 if dx > 0 else -1
        else:
            row += 1 if dy > 0 else -1
    return max_range, None


def largest_free_square(occupied: NDArray[np.bool_], row: int, col: int, quadrant: int) -> int:
    """Side of the largest free square of the grid that has the cell in its corner, by trying one size after the other."""
    rows, cols = occupied.shape
    side = 0
    while True:
        side += 1
        r = row - side + 1 if quadrant // 2 else row
        c = col - side + 1 if quadrant % 2 else col
        inside = r >= 0 and c >= 0 and r + side <= rows and c + side <= cols
        if not inside or occupied[r : r + side, c : c + side].any():
            return side - 1


def cells_along(x0: float, y0: float, x1: float, y1: float) -> list[tuple[int, int]]:
    """Cells (row, col) that the line from (x0, y0) to (x1, y1) passes, sorted by where the line enters them."""
    right, up = (1 if x1 > x0 else -1), (1 if y1 > y0 else -1)
    cols = range(math.floor(min(x0, x1)) + 1, math.floor(max(x0, x1)) + 1)
    rows = range(math.floor(min(y0, y1)) + 1, math.floor(max(y0, y1)) + 1)
    crossings = [((col - x0) / (x1 - x0), 0, right) for col in cols]
    crossings += [((row - y0) / (y1 - y0), up, 0) for row in rows]
    cells = [(math.floor(y0), math.floor(x0))]
    for _, d_row, d_col in sorted(crossings):
        row, col = cells[-1]
        cells.append((row + d_row, col + d_col))
    return cells
