"""Log-odds insertion, written for the eye: the cells of a beam by cutting it at every grid line."""

from __future__ import annotations

import math
from itertools import pairwise


def crossed_cells(x0: float, y0: float, x1: float, y1: float) -> list[tuple[int, int]]:
    """Cells (row, col) that the way from (x0, y0) to (x1, y1) leads through, in cells, the last one left out."""
    cuts = {0.0, 1.0}
    for a, b in ((x0, x1), (y0, y1)):
        if a != b:
            lo, hi = sorted((a, b))
            cuts |= {(line - a) / (b - a) for line in range(math.ceil(lo), math.floor(hi) + 1)}
    times = sorted(t for t in cuts if 0.0 <= t <= 1.0)
    cells: list[tuple[int, int]] = []
    for early, late in pairwise(times):
        middle = 0.5 * (early + late)
        cell = math.floor(y0 + middle * (y1 - y0)), math.floor(x0 + middle * (x1 - x0))
        if not cells or cells[-1] != cell:
            cells.append(cell)
    end = math.floor(y1), math.floor(x1)
    return [cell for cell in cells if cell != end]


def insert(
    cells: dict[tuple[int, int], float],
    x0: float,
    y0: float,
    ends: list[tuple[float, float]],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """Beam after beam: `miss` for every crossed cell, `hit` for the last, within +-limit."""
    for x1, y1 in ends:
        for cell in crossed_cells(x0, y0, x1, y1):
            cells[cell] = min(max(cells.get(cell, 0.0) + miss, -limit), limit)
        end = math.floor(y1), math.floor(x1)
        cells[end] = min(max(cells.get(end, 0.0) + hit, -limit), limit)


def insert_once(
    cells: dict[tuple[int, int], float],
    x0: float,
    y0: float,
    ends: list[tuple[float, float]],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """The beams of one scan together: a cell is changed once, and a hit beats a miss."""
    hits = {(math.floor(y), math.floor(x)) for x, y in ends}
    crossed = {cell for end in ends for cell in crossed_cells(x0, y0, *end)} - hits
    for changed, step in ((hits, hit), (crossed, miss)):
        for cell in changed:
            cells[cell] = min(max(cells.get(cell, 0.0) + step, -limit), limit)
