"""Fast marching: the time at which a front that starts at some cells arrives everywhere, and the steepest way back."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def arrival_costs(
    price: NDArray[np.float32], sources: NDArray[np.int64], stop: int, beyond: float
) -> NDArray[np.float32]:
    """Least cost from every cell's centre to the nearest source, in cells times price (Sethian 1996, first order).

    `price` `(rows, cols)` is the cost of a cell's width, infinite where nothing passes; `sources` are flat indices. The front
    ends `beyond` after it has reached the cell `stop` (-1: never); cells that it has not reached cost infinitely much.
    """
    rows, cols = price.shape
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
            limit = float(here) + beyond
        row, col = cell // cols, cell % cols
        for k in range(4):
            r = row + (1 if k == 0 else -1 if k == 1 else 0)
            c = col + (1 if k == 2 else -1 if k == 3 else 0)
            if r < 0 or c < 0 or r >= rows or c >= cols:
                continue
            there = int(r * cols + c)
            if done[there] or price[r, c] == np.inf:
                continue
            new = np.float32(_eikonal(cost, done, rows, cols, r, c, price[r, c]))
            if new < cost[there]:
                cost[there] = new
                heapq.heappush(queue, (new, np.int64(there)))
    for at in range(rows * cols):
        if not done[at]:
            cost[at] = np.inf
    return cost.reshape((rows, cols))


@compiled
def _eikonal(
    cost: NDArray[np.float32], done: NDArray[np.bool_], rows: int, cols: int, r: int, c: int, price: float
) -> float:
    """The upwind solution of |grad cost| = price at a cell from its settled neighbours."""
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
    if abs(a - b) >= price or a == np.inf or b == np.inf:
        return min(a, b) + price
    return float(0.5 * (a + b + np.sqrt(2.0 * price * price - (a - b) ** 2)))


@compiled
def descend_costs(
    cost: NDArray[np.float32], x: float, y: float, step: float, most: int
) -> NDArray[np.float64]:
    """Steepest descent on a cost field from (x, y), in cells: the way `(n, 2)` as x, y, to a cell of cost 0 or as far as it goes.

    The gradient is that of the bilinear interpolation between cells' centres; where it leads nowhere (beside closed cells) the
    way goes on to the centre of the cheapest neighbour.
    """
    rows, cols = cost.shape
    way = np.empty((most, 2))
    way[0, 0], way[0, 1] = x, y
    n = 1
    lowest = np.inf
    while n < most:
        row, col = int(np.floor(y)), int(np.floor(x))
        if row < 0 or col < 0 or row >= rows or col >= cols or cost[row, col] == 0.0:
            break
        moved = False
        gx, gy = _gradient(cost, x, y)
        norm = np.hypot(gx, gy)
        if norm > 1e-6 and norm < 1e6:
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
        way[n, 0], way[n, 1] = x, y
        n += 1
    return way[:n].copy()


@compiled
def _corner(cost: NDArray[np.float32], x: float, y: float) -> tuple[int, int, float, float]:
    """The lower left of the four cells' centres about a point, and the point's shares of the way to the others."""
    rows, cols = cost.shape
    r = min(max(int(np.floor(y - 0.5)), 0), rows - 2)
    c = min(max(int(np.floor(x - 0.5)), 0), cols - 2)
    return r, c, min(max(x - 0.5 - c, 0.0), 1.0), min(max(y - 0.5 - r, 0.0), 1.0)


@compiled
def _bilinear(cost: NDArray[np.float32], x: float, y: float) -> float:
    r, c, u, v = _corner(cost, x, y)
    a, b, d, e = cost[r, c], cost[r, c + 1], cost[r + 1, c], cost[r + 1, c + 1]
    if a == np.inf or b == np.inf or d == np.inf or e == np.inf:
        return np.inf
    return float((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * d + u * e))


@compiled
def _gradient(cost: NDArray[np.float32], x: float, y: float) -> tuple[float, float]:
    """Zero beside closed cells, where nothing can be interpolated."""
    r, c, u, v = _corner(cost, x, y)
    a, b, d, e = cost[r, c], cost[r, c + 1], cost[r + 1, c], cost[r + 1, c + 1]
    if a == np.inf or b == np.inf or d == np.inf or e == np.inf:
        return 0.0, 0.0
    return (1 - v) * (b - a) + v * (e - d), (1 - u) * (d - a) + u * (e - b)
