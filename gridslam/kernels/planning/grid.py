"""Cost-to-go over the cells of a map, the path of cells that descends it, and string pulling."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import CollisionWorld, is_free

DIAGONAL = np.sqrt(2.0)
SEARCH_MARGIN_M = 2.0  # the search goes on at least this far beyond the start


@compiled
def cost_to_go(
    field: NDArray[np.float32],
    resolution: float,
    required: float,
    obstacle_weight: float,
    inflation_radius: float,
    goal: int,
    start: int,
    search_factor: float,
) -> NDArray[np.float32]:
    """Cost (m) `(rows, cols)` from every cell to the goal over 8 neighbours (Dijkstra 1959); infinite if it was not reached.

    `field` is the distance (m) to the nearest obstacle as of `clearance`; cells have the size `resolution` (m). Cells whose
    centre has less than `required` (m) clearance are closed. A metre costs 1, rising to 1 + `obstacle_weight` as the clearance
    beyond `required` falls from `inflation_radius` (m) to 0. `goal` and `start` are flat indices. The search ends at
    `search_factor` times the cost of the start.
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
            limit = np.float32(here * search_factor + SEARCH_MARGIN_M)
        row, col = cell // cols, cell % cols
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= rows or c >= cols:
                    continue
                there = r * cols + c
                spare_clearance = field[2 * r + 1, 2 * c + 1] - required
                if done[there] or spare_clearance < 0.0:
                    continue
                if field[2 * row + 1 + dr, 2 * col + 1 + dc] < required:
                    continue
                step = resolution * (DIAGONAL if dr != 0 and dc != 0 else 1.0)
                new = np.float32(
                    here + step * (1.0 + obstacle_weight * max(0.0, 1.0 - spare_clearance / inflation_radius))
                )
                if new < cost[there]:
                    cost[there] = new
                    heapq.heappush(queue, (new, np.int32(there)))
    for i in range(rows * cols):
        if not done[i]:
            cost[i] = np.inf
    return cost.reshape((rows, cols))


@compiled
def descend(cost: NDArray[np.float32], start: int) -> NDArray[np.int64]:
    """Cells (row, col) `(n, 2)` downhill from the flat index `start` to the goal, where the cost is 0; empty without a path."""
    rows, cols = cost.shape
    row, col = start // cols, start % cols
    cells = np.empty((rows * cols, 2), np.int64)
    n = 0
    if not np.isfinite(cost[row, col]):
        return cells[:0].copy()
    while True:
        cells[n, 0], cells[n, 1] = row, col
        n += 1
        if cost[row, col] == 0.0:
            return cells[:n].copy()
        best, largest_drop = np.inf, 0.0
        at_r, at_c = row, col
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= rows or c >= cols:
                    continue
                drop = (cost[row, col] - cost[r, c]) / (DIAGONAL if dr != 0 and dc != 0 else 1.0)
                if cost[r, c] < cost[row, col] and drop > largest_drop:
                    largest_drop, best = drop, cost[r, c]
                    at_r, at_c = r, c
        if best == np.inf:
            return cells[:0].copy()
        row, col = at_r, at_c


@compiled
def pull_string(
    world: CollisionWorld,
    points: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Corners `(m, 2)` of a shorter polyline through the same free space as the one over `points` `(n, 2)` (m).

    From each corner the next one is the farthest point that a straight drive reaches, found by doubling and bisection.
    """
    n = points.shape[0]
    kept = np.empty((n, 2))
    kept[0] = points[0]
    count, at = 1, 0
    while at < n - 1:
        low, step = at + 1, 2
        high = n
        while at + step < n:
            if _is_line_free(world, points[at], points[at + step]):
                low = at + step
                step *= 2
            else:
                high = at + step
                break
        if high == n and _is_line_free(world, points[at], points[n - 1]):
            low = n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if _is_line_free(world, points[at], points[middle]):
                low = middle
            else:
                high = middle
        at = low
        kept[count] = points[at]
        count += 1
    return kept[:count].copy()


@compiled
def _is_line_free(
    world: CollisionWorld,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
) -> bool:
    """Whether the robot can drive straight from point a to point b."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    return bool(is_free(world, a[0], a[1], yaw=np.arctan2(dy, dx), length=np.hypot(dx, dy), curvature=0.0))
