"""Shortest ways over the cells of a map, near obstacles dearer if wanted, and taut strings."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import World, is_free

DIAGONAL = np.sqrt(2.0)


@compiled
def cost_to_go(
    field: NDArray[np.float32],
    resolution: float,
    needed: float,
    dread: float,
    shy_of: float,
    goal: int,
    start: int,
    beyond: float,
) -> NDArray[np.float32]:
    """Cost (m) from every cell's centre to the goal's, over 8 neighbours (Dijkstra 1959); infinite where none was found.

    Cells whose centre is nearer than `needed` (m) to an obstacle are closed. A metre costs 1, and up to 1 + `dread` where the
    clearance to spare falls from `shy_of` (m) to 0. `goal` and `start` are cells' flat indices; the search ends at
    `beyond` times the start's cost.
    """
    rows, cols = field.shape[0] // 2, field.shape[1] // 2
    cost = np.full(rows * cols, np.inf, np.float32)
    done = np.zeros(rows * cols, np.bool_)
    cost[goal] = 0.0
    queue = [(np.float32(0.0), np.int32(goal))]
    limit = np.float32(np.inf)
    while len(queue) > 0:
        here, cell = heapq.heappop(queue)
        if done[cell]:
            continue
        if here > limit:
            cost[cell] = np.inf
            break
        done[cell] = True
        if cell == start:
            limit = np.float32(here * beyond + 2.0)
        row, col = cell // cols, cell % cols
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= rows or c >= cols:
                    continue
                there = r * cols + c
                spare = field[2 * r + 1, 2 * c + 1] - needed
                if done[there] or spare < 0.0:
                    continue
                if field[2 * row + 1 + dr, 2 * col + 1 + dc] < needed:
                    continue
                step = resolution * (DIAGONAL if dr != 0 and dc != 0 else 1.0)
                new = np.float32(here + step * (1.0 + dread * max(0.0, 1.0 - spare / shy_of)))
                if new < cost[there]:
                    cost[there] = new
                    heapq.heappush(queue, (new, np.int32(there)))
    for i in range(rows * cols):
        if not done[i]:
            cost[i] = np.inf
    return cost.reshape((rows, cols))


@compiled
def descend(cost: NDArray[np.float32], start: int) -> NDArray[np.int64]:
    """Cells (row, col) `(n, 2)` downhill from a cell to the goal, where the cost is 0; empty if the cell has no cost."""
    rows, cols = cost.shape
    row, col = start // cols, start % cols
    way = np.empty((rows * cols, 2), np.int64)
    n = 0
    if not np.isfinite(cost[row, col]):
        return way[:0].copy()
    while True:
        way[n, 0], way[n, 1] = row, col
        n += 1
        if cost[row, col] == 0.0:
            return way[:n].copy()
        best, steepest = np.inf, 0.0
        at_r, at_c = row, col
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= rows or c >= cols:
                    continue
                drop = (cost[row, col] - cost[r, c]) / (DIAGONAL if dr != 0 and dc != 0 else 1.0)
                if cost[r, c] < cost[row, col] and drop > steepest:
                    steepest, best = drop, cost[r, c]
                    at_r, at_c = r, c
        if best == np.inf:
            return way[:0].copy()
        row, col = at_r, at_c


@compiled
def pull_taut(
    world: World,
    points: NDArray[np.float64],
) -> NDArray[np.float64]:
    """The corners `(m, 2)` of a shorter way through the same free space as the way over `points` `(n, 2)` (m).

    From each corner the next is the farthest point that a straight drive reaches, found by doubling the reach and halving it.
    """
    n = points.shape[0]
    kept = np.empty((n, 2))
    kept[0] = points[0]
    count, at = 1, 0
    while at < n - 1:
        low, step = at + 1, 2
        high = n
        while at + step < n:
            if _sees(world, points[at], points[at + step]):
                low = at + step
                step *= 2
            else:
                high = at + step
                break
        if high == n and _sees(world, points[at], points[n - 1]):
            low = n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if _sees(world, points[at], points[middle]):
                low = middle
            else:
                high = middle
        at = low
        kept[count] = points[at]
        count += 1
    return kept[:count].copy()


@compiled
def _sees(
    world: World,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
) -> bool:
    dx, dy = b[0] - a[0], b[1] - a[1]
    return bool(is_free(world, a[0], a[1], np.arctan2(dy, dx), np.hypot(dx, dy), 0.0))
