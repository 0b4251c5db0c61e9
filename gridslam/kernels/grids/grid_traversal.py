"""Traversal of the grid cells that a straight line crosses, one cell after the other (Amanatides and Woo 1987).

A kernel starts a `Traversal`, reads its `row` and `col`, and replaces it by `advance(traversal)`. Compiled code keeps the fields
in registers, so a step costs no more than with local variables.
Coordinates are in cells: cell (row, col) covers [col, col + 1) x [row, row + 1).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridslam.kernels.compiled import compiled


class Traversal(NamedTuple):
    """The current cell, and where the line crosses the next grid lines.

    `next_row` and `next_col` are line parameters (in any unit) at which the line enters the next row and the next column;
    `per_row` and `per_col` are their increments from one row or column to the next.
    """

    row: int
    col: int
    step_row: int
    step_col: int
    next_row: float
    next_col: float
    per_row: float
    per_col: float


@compiled
def start_traversal(x0: float, y0: float, x1: float, y1: float) -> Traversal:
    """A traversal from (x0, y0) towards (x1, y1), in cells; the line parameter is 0 at the start and 1 at the end."""
    row, col = int(np.floor(y0)), int(np.floor(x0))
    dx, dy = x1 - x0, y1 - y0
    step_col, step_row = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
    per_col = abs(1.0 / dx) if dx != 0.0 else np.inf
    per_row = abs(1.0 / dy) if dy != 0.0 else np.inf
    next_col = ((col + 1 - x0) if dx > 0 else (x0 - col)) * per_col if dx != 0.0 else np.inf
    next_row = ((row + 1 - y0) if dy > 0 else (y0 - row)) * per_row if dy != 0.0 else np.inf
    return Traversal(
        row=row,
        col=col,
        step_row=step_row,
        step_col=step_col,
        next_row=next_row,
        next_col=next_col,
        per_row=per_row,
        per_col=per_col,
    )


@compiled
def steps_to(traversal: Traversal, endpoint_row: int, endpoint_col: int) -> int:
    """Number of `advance` calls from the current cell to the cell (endpoint_row, endpoint_col) of the line's end."""
    return abs(endpoint_row - traversal.row) + abs(endpoint_col - traversal.col)


@compiled
def advance(t: Traversal) -> Traversal:
    """The traversal in the next cell of the line; through a corner it takes the row first."""
    row, col, next_row, next_col = t.row, t.col, t.next_row, t.next_col
    if next_col < next_row:
        col += t.step_col
        next_col += t.per_col
    else:
        row += t.step_row
        next_row += t.per_row
    return Traversal(
        row=row,
        col=col,
        step_row=t.step_row,
        step_col=t.step_col,
        next_row=next_row,
        next_col=next_col,
        per_row=t.per_row,
        per_col=t.per_col,
    )
