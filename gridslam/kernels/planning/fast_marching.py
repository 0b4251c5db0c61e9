"""Fast marching over a grid of cell costs, and steepest descent on the resulting cost-to-go."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

MIN_SLOPE, MAX_SLOPE = 1e-6, 1e6  # gradients that a descent follows


@compiled
def arrival_costs(
    cell_cost: NDArray[np.float32], sources: NDArray[np.int64], stop: int, margin: float
) -> NDArray[np.float32]:
    """Lowest cost `(rows, cols)` from every cell's centre to the nearest source, by fast marching (Sethian 1996, first order).

    `cell_cost` `(rows, cols)` is the cost of crossing one cell, infinite if it is closed; `sources` are flat indices. The front
    stops `margin` after it has reached the cell `stop` (-1: never); cells that it has not reached get infinite cost.
    """
    rows, cols = cell_cost.shape
    cost = np.full(rows * cols, np.inf, np.float32)
    done = np.zeros(rows * cols, np.bool_)
    queue = [(np.float32(0.0), np.int64(0)) for _ in range(0)]
    for source in sources:
        cost[source] = 0.0
        heapq.heappush(queue, (np.float32(0.0), np.int64(source)))
    limit = np.inf
    while len(queue) > 0:
        here, cell = heapq.heappop(queue)
        if done[cell]:
            continue
        if here > limit:
            break
        done[cell] = True
        if cell == stop:
            limit = float(here) + margin
        row, col = cell // cols, cell % cols
        for k in range(4):
            r = row + (1 if k == 0 else -1 if k == 1 else 0)
            c = col + (1 if k == 2 else -1 if k == 3 else 0)
            if r < 0 or c < 0 or r >= rows or c >= cols:
                continue
            there = int(r * cols + c)
            if done[there] or cell_cost[r, c] == np.inf:
                continue
            new = np.float32(_eikonal(cost, done, rows, cols=cols, r=r, c=c, cell_cost=cell_cost[r, c]))
            if new < cost[there]:
                cost[there] = new
                heapq.heappush(queue, (new, np.int64(there)))
    for at in range(rows * cols):
        if not done[at]:
            cost[at] = np.inf
    return cost.reshape((rows, cols))


@compiled
def _eikonal(
    cost: NDArray[np.float32], done: NDArray[np.bool_], rows: int, cols: int, r: int, c: int, cell_cost: float
) -> float:
    """The upwind solution of |grad cost| = cell_cost at a cell, from its settled neighbours."""
    at = r * cols + c
    a = b = np.inf
    if r > 0 and done[at - cols]:
        a = min(a, cost[at - cols])
    if r + 1 < rows and done[at + cols]:
        a = min(a, cost[at + cols])
    if c > 0 and done[at - 1]:
        b = min(b, cost[at - 1])
    if c + 1 < cols and done[at + 1]:
        b = min(b, cost[at + 1])
    if abs(a - b) >= cell_cost or a == np.inf or b == np.inf:
        return min(a, b) + cell_cost
    return float(0.5 * (a + b + np.sqrt(2.0 * cell_cost * cell_cost - (a - b) ** 2)))


@compiled
def descend_costs(
    cost: NDArray[np.float32], x: float, y: float, step: float, max_points: int
) -> NDArray[np.float64]:
    """Path `(n, 2)` (x, y in cells) of steepest descent on a cost field from (x, y), to a cell of cost 0 or as far as it leads.

    The gradient is that of the bilinear interpolation between cell centres. Where it leads nowhere, beside closed cells, the
    path steps to the centre of the cheapest neighbour. `step` is the step length in cells.
    """
    rows, cols = cost.shape
    path = np.empty((max_points, 2))
    path[0, 0], path[0, 1] = x, y
    n = 1
    lowest = np.inf
    while n < max_points:
        row, col = int(np.floor(y)), int(np.floor(x))
        if row < 0 or col < 0 or row >= rows or col >= cols or cost[row, col] == 0.0:
            break
        moved = False
        gx, gy = _gradient(cost, x, y)
        norm = np.hypot(gx, gy)
        if norm > MIN_SLOPE and norm < MAX_SLOPE:
            nx, ny = x - step * gx / norm, y - step * gy / norm
            value = _bilinear(cost, nx, ny)
            if value < lowest:
                x, y, lowest = nx, ny, value
                moved = True
        if not moved:
            best = cost[row, col]
            br, bc = row, col
            for dr in range(-1, 2):
                for dc in range(-1, 2):
                    r, c = row + dr, col + dc
                    if r < 0 or c < 0 or r >= rows or c >= cols or not cost[r, c] < best:
                        continue
                    # never cut the corner of a closed cell
                    if dr != 0 and dc != 0 and (cost[row, c] == np.inf or cost[r, col] == np.inf):
                        continue
                    best, br, bc = cost[r, c], r, c
            if br == row and bc == col:
                break
            x, y, lowest = bc + 0.5, br + 0.5, best
        path[n, 0], path[n, 1] = x, y
        n += 1
    return path[:n].copy()


@compiled
def _corner(cost: NDArray[np.float32], x: float, y: float) -> tuple[int, int, float, float]:
    """Row and column of the lower left of the four cell centres around a point, and the point's fractions towards the others."""
    rows, cols = cost.shape
    r = min(max(int(np.floor(y - 0.5)), 0), rows - 2)
    c = min(max(int(np.floor(x - 0.5)), 0), cols - 2)
    return r, c, min(max(x - 0.5 - c, 0.0), 1.0), min(max(y - 0.5 - r, 0.0), 1.0)


@compiled
def _bilinear(cost: NDArray[np.float32], x: float, y: float) -> float:
    """The cost at a point, infinite beside closed cells."""
    r, c, u, v = _corner(cost, x, y)
    a, b, d, e = cost[r, c], cost[r, c + 1], cost[r + 1, c], cost[r + 1, c + 1]
    if a == np.inf or b == np.inf or d == np.inf or e == np.inf:
        return np.inf
    return float((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * e))


@compiled
def _gradient(cost: NDArray[np.float32], x: float, y: float) -> tuple[float, float]:
    """The cost gradient (d/dx, d/dy) at a point; zero beside closed cells."""
    r, c, u, v = _corner(cost, x, y)
    a, b, d, e = cost[r, c], cost[r, c + 1], cost[r + 1, c], cost[r + 1, c + 1]
    if a == np.inf or b == np.inf or d == np.inf or e == np.inf:
        return 0.0, 0.0
    return (1 - v) * (b - a) + v * (e - d), (1 - u) * (d - a) + u * (e - b)
