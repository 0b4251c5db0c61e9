"""Reference implementations of the explorer's planning."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def eikonal_by_sweeps(cell_cost: Floats, sources: list[tuple[int, int]]) -> Floats:
    """The upwind solution of |grad cost| = cell_cost, by updating all cells until none changes."""
    rows, cols = cell_cost.shape
    cost = np.full((rows, cols), np.inf)
    for cell in sources:
        cost[cell] = 0.0
    changed = True
    while changed:
        changed = False
        for r, c in itertools.product(range(rows), range(cols)):
            if not math.isfinite(cell_cost[r, c]) or (r, c) in sources:
                continue
            a = min((cost[i, c] for i in (r - 1, r + 1) if 0 <= i < rows), default=math.inf)
            b = min((cost[r, j] for j in (c - 1, c + 1) if 0 <= j < cols), default=math.inf)
            new = min(a, b) + cell_cost[r, c]
            if math.isfinite(a) and math.isfinite(b) and abs(a - b) < cell_cost[r, c]:
                new = 0.5 * (a + b + math.sqrt(2.0 * cell_cost[r, c] ** 2 - (a - b) ** 2))
            if new < cost[r, c] - 1e-9:
                cost[r, c] = new
                changed = True
    return cost


def shortest_tour_length(distances: Floats) -> float:
    """The length of the shortest open tour from place 0, over all orders."""
    others = range(1, len(distances))
    return min(
        sum(distances[a, b] for a, b in itertools.pairwise((0, *order)))
        for order in itertools.permutations(others)
    )


def minimum_cover(visible: NDArray[np.bool_]) -> int:
    """The number of rows of `visible` `(p, n)` in a minimum cover, by integer programming."""
    from scipy.optimize import Bounds, LinearConstraint, milp

    coverable = visible[:, visible.any(axis=0)].astype(float)
    count = len(visible)
    solved = milp(
        np.ones(count),
        constraints=LinearConstraint(coverable.T, lb=1.0),
        integrality=np.ones(count),
        bounds=Bounds(0, 1),
    )
    return round(solved.fun)


def distance_until_collision(
    left: float, right: float, obstacles: Floats, base: float, radius: float, max_distance: float
) -> float:
    """Distance that a disc drives along an arc in steps of a millimetre before it collides with a point."""
    forward, yaw_rate = 0.5 * (left + right), (right - left) / base
    step = 0.001
    x = y = yaw = distance = 0.0
    before = np.hypot(obstacles[:, 0], obstacles[:, 1])
    while distance < max_distance:
        yaw_step = yaw_rate / abs(forward) * step
        x += math.copysign(step, forward) * math.cos(yaw + 0.5 * yaw_step)
        y += math.copysign(step, forward) * math.sin(yaw + 0.5 * yaw_step)
        yaw += yaw_step
        gaps = np.hypot(obstacles[:, 0] - x, obstacles[:, 1] - y)
        if ((gaps < radius) & (gaps < before)).any():
            return distance
        before = gaps
        distance += step
    return max_distance
