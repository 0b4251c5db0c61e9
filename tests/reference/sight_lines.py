"""What points see and what beams pass, by following every line in small steps or from cell to cell."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tests.reference.ray_traversal import cast_cell_by_cell

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]


def seen_walls(walls: Cells, free: Cells, place: tuple[float, float], reach: float) -> set[int]:
    """The wall cells (flat indices) of which any side towards a free cell is seen from a place (x, y in cells)."""
    rows, cols = walls.shape
    seen = set()
    for r, c in np.argwhere(walls).tolist():
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if not (0 <= r + dr < rows and 0 <= c + dc < cols and free[r + dr, c + dc]):
                continue
            dx, dy = c + 0.5 + 0.5 * dc - place[0], r + 0.5 + 0.5 * dr - place[1]
            away = math.hypot(dx, dy)
            if away <= reach:
                way, _ = cast_cell_by_cell(walls, *place, math.atan2(dy, dx), away)
                if way >= away - 0.5:
                    seen.add(r * cols + c)
    return seen


def passed_and_hit(
    shape: tuple[int, int],
    origin: Floats,
    ends: Floats,
    is_hit: Cells,
    reach: float,
    stand_off: float,
    joined: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """How many beams passed each cell, looked at once a cell's width, and how many surfaces lie in it."""
    passed, hit = np.zeros(shape, np.int64), np.zeros(shape, np.int64)

    def cell(x: float, y: float) -> tuple[int, int] | None:
        row, col = math.floor(y), math.floor(x)
        return (row, col) if 0 <= row < shape[0] and 0 <= col < shape[1] else None

    for i, end in enumerate(ends):
        away = math.dist(origin, end)
        length = min(away - stand_off if is_hit[i] else away, reach)
        cells = [cell(*(origin + (k + 0.5) / away * (end - origin))) for k in range(int(length))]
        inside = cells[: cells.index(None)] if None in cells else cells
        for before, here in zip([None, *inside], inside, strict=False):
            if here is not None and here != before:
                passed[here] += 1
        if not is_hit[i] or away > reach:
            continue
        neighbour = ends[(i + 1) % len(ends)]
        gap = math.dist(end, neighbour)
        marks = int(2.0 * gap) + 1 if is_hit[(i + 1) % len(ends)] and gap <= joined else 1
        for k in range(marks):
            here = cell(*(end + k / marks * (neighbour - end)))
            if here is not None:
                hit[here] += 1
    return passed, hit
