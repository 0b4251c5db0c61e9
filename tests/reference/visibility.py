"""Reference implementations of visibility and of beam counts, by following every line from cell to cell."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tests.reference.ray_traversal import cast_cell_by_cell

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]


def visible_walls(walls: Cells, free: Cells, place: tuple[float, float], max_range: float) -> set[int]:
    """The wall cells (flat indices) with any side towards a free cell visible from a place (x, y in cells)."""
    rows, cols = walls.shape
    visible = set()
    for r, c in np.argwhere(walls).tolist():
        for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            if not (0 <= r + dr < rows and 0 <= c + dc < cols and free[r + dr, c + dc]):
                continue
            dx, dy = c + 0.5 + 0.5 * dc - place[0], r + 0.5 + 0.5 * dr - place[1]
            distance = math.hypot(dx, dy)
            if distance <= max_range:
                hit_distance, _ = cast_cell_by_cell(walls, *place, math.atan2(dy, dx), distance)
                if hit_distance >= distance - 0.5:
                    visible.add(r * cols + c)
    return visible


def passed_and_hit(
    shape: tuple[int, int],
    origin: Floats,
    endpoints: Floats,
    is_hit: Cells,
    max_range: float,
    stand_off: float,
    max_gap: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Counts of beams that pass each cell, sampled once per cell width, and of surfaces in it."""
    passed, hit = np.zeros(shape, np.int64), np.zeros(shape, np.int64)

    def cell(x: float, y: float) -> tuple[int, int] | None:
        row, col = math.floor(y), math.floor(x)
        return (row, col) if 0 <= row < shape[0] and 0 <= col < shape[1] else None

    for i, end in enumerate(endpoints):
        distance = math.dist(origin, end)
        length = min(distance - stand_off if is_hit[i] else distance, max_range)
        cells = [cell(*(origin + (k + 0.5) / distance * (end - origin))) for k in range(int(length))]
        inside = cells[: cells.index(None)] if None in cells else cells
        for before, here in zip([None, *inside], inside, strict=False):
            if here is not None and here != before:
                passed[here] += 1
        if not is_hit[i] or distance > max_range:
            continue
        neighbour = endpoints[(i + 1) % len(endpoints)]
        gap = math.dist(end, neighbour)
        marks = int(2.0 * gap) + 1 if is_hit[(i + 1) % len(endpoints)] and gap <= max_gap else 1
        for k in range(marks):
            here = cell(*(end + k / marks * (neighbour - end)))
            if here is not None:
                hit[here] += 1
    return passed, hit
