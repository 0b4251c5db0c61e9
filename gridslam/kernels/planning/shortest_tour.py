"""Open tours over a table of distances: the optimum for few places, local search for many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled


@compiled
def exact_tour(distances: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order `(n,)` of the shortest tour from place 0 through all others (Held and Karp 1962). Memory grows with n 2^n."""
    n = distances.shape[0] - 1
    full = 1 << n
    best = np.full((full, n), np.inf)
    predecessor = np.full((full, n), -1, np.int64)
    for j in range(n):
        best[1 << j, j] = distances[0, j + 1]
    for visited in range(1, full):
        for last in range(n):
            here = best[visited, last]
            if here == np.inf or not visited >> last & 1:
                continue
            for j in range(n):
                if visited >> j & 1:
                    continue
                new = here + distances[last + 1, j + 1]
                if new < best[visited | 1 << j, j]:
                    best[visited | 1 << j, j] = new
                    predecessor[visited | 1 << j, j] = last
    order = np.zeros(n + 1, np.int64)
    visited, last = full - 1, int(best[full - 1].argmin())
    for at in range(n, 0, -1):
        order[at] = last + 1
        visited, last = visited & ~(1 << last), predecessor[visited, last]
    return order


@compiled
def improved_tour(distances: NDArray[np.float64], start: NDArray[np.int64]) -> NDArray[np.int64]:
    """The tour `(n,)` after reversals (2-opt) and moves of up to three places (or-opt), until neither shortens it.

    The first place is fixed, the last is free.
    """
    order = start.copy()
    n = len(order)
    better = True
    while better:
        better = False
        for i in range(1, n - 1):
            for j in range(i + 1, n):
                gain = distances[order[i - 1], order[i]] - distances[order[i - 1], order[j]]
                if j + 1 < n:
                    gain += distances[order[j], order[j + 1]] - distances[order[i], order[j + 1]]
                if gain > 1e-9:
                    order[i : j + 1] = order[i : j + 1][::-1].copy()
                    better = True
        for size in range(1, 4):
            for i in range(1, n - size + 1):
                if _move_block(distances, order, i, size):
                    better = True
    return order


@compiled
def _move_block(distances: NDArray[np.float64], order: NDArray[np.int64], i: int, size: int) -> bool:
    """Move `size` places from index `i` on to where they cost least, in either orientation; whether the tour got shorter."""
    n = len(order)
    first, last = order[i], order[i + size - 1]
    removed = distances[order[i - 1], first]
    if i + size < n:
        removed += distances[last, order[i + size]] - distances[order[i - 1], order[i + size]]
    rest = np.concatenate((order[:i], order[i + size :]))
    lowest, at, is_reversed = removed - 1e-9, -1, False
    for k in range(1, len(rest) + 1):
        after = k < len(rest)
        link = distances[rest[k - 1], rest[k]] if after else 0.0
        forward = distances[rest[k - 1], first] - link + (distances[last, rest[k]] if after else 0.0)
        reverse = distances[rest[k - 1], last] - link + (distances[first, rest[k]] if after else 0.0)
        if forward < lowest:
            lowest, at, is_reversed = forward, k, False
        if reverse < lowest:
            lowest, at, is_reversed = reverse, k, True
    if at < 0:
        return False
    block = order[i : i + size].copy()
    if is_reversed:
        block = block[::-1].copy()
    order[:] = np.concatenate((rest[:at], block, rest[at:]))
    return True
