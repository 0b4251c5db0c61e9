"""The order in which to visit places: an open travelling salesman tour from the start (handmap-slam, paper section 3.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.fast_marching import arrival_costs
from gridslam.kernels.planning.shortest_tour import exact_tour, improved_tour

Floats = NDArray[np.float64]

MAX_EXACT = 12  # number of places besides the start up to which the optimum is computed
KICKS = 300  # restarts of the local search, each from the best tour so far with two pieces swapped
MIN_GAIN = 1e-9  # smallest gain at which a tour replaces the best one
UNREACHABLE_COST = 1e6  # replaces an infinite distance; the tour avoids such links


def path_costs(cell_cost: NDArray[np.float32], cells: NDArray[np.int64]) -> Floats:
    """Costs `(k, k)` of the paths between cells `(k, 2)` (row, col) over `cell_cost`; infinite without a path."""
    flat = np.ravel_multi_index((cells[:, 0], cells[:, 1]), cell_cost.shape).astype(np.int64)
    table = np.empty((len(flat), len(flat)))
    for i, cell in enumerate(flat):
        cost = np.asarray(arrival_costs(cell_cost, np.array([cell]), -1, np.inf))
        table[i] = cost.ravel()[flat]
    return np.asarray(0.5 * (table + table.T))


def plan_tour(distances: Floats, rng: np.random.Generator) -> NDArray[np.int64]:
    """Order `(k,)` in which to visit all places from place 0 on, by the distances `(k, k)` between them.

    The last place is free. Up to 12 places besides the start this is the optimum (Held and Karp 1962), beyond that the result of
    an iterated local search (2-opt and or-opt with double bridges, Lourenco et al. 2003).
    """
    table = np.ascontiguousarray(
        np.where(np.isfinite(distances), distances, UNREACHABLE_COST), dtype=np.float64
    )
    if len(table) <= 2:
        return np.arange(len(table))
    if len(table) <= MAX_EXACT + 1:
        return np.asarray(exact_tour(table))
    best = np.asarray(improved_tour(table, _nearest_neighbour_tour(table)))
    length = tour_length(table, best)
    for _ in range(KICKS):
        tried = np.asarray(improved_tour(table, _double_bridge(best, rng)))
        if (new := tour_length(table, tried)) < length - MIN_GAIN:
            best, length = tried, new
    return best


def tour_length(distances: Floats, order: NDArray[np.int64]) -> float:
    """Length of an open tour in the given order `(k,)`, by the distances `(k, k)` between places."""
    return float(distances[order[:-1], order[1:]].sum())


def _nearest_neighbour_tour(table: Floats) -> NDArray[np.int64]:
    """The tour that always goes to the nearest place not visited yet."""
    order, remaining = [0], set(range(1, len(table)))
    while remaining:
        nearest = min(remaining, key=lambda j: (table[order[-1], j], j))
        order.append(nearest)
        remaining.remove(nearest)
    return np.array(order, np.int64)


def _double_bridge(order: NDArray[np.int64], rng: np.random.Generator) -> NDArray[np.int64]:
    """The tour with two neighbouring pieces swapped; the first place is fixed."""
    a, b, c = np.sort(rng.choice(np.arange(1, len(order)), 3, replace=False))
    return np.concatenate([order[:a], order[b:c], order[a:b], order[c:]])
