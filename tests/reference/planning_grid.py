"""Reference implementations of the planner's clearances, costs and times."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

Floats = NDArray[np.float64]


def distance_to_squares(blocked: NDArray[np.bool_], resolution_m: float, points: Floats) -> Floats:
    """Distance (m) of points `(n, 2)` to the nearest blocked square, by testing all of them."""
    centres = (np.argwhere(blocked)[:, ::-1] + 0.5) * resolution_m
    gaps = np.maximum(np.abs(points[:, None] - centres[None]) - 0.5 * resolution_m, 0.0)
    return np.asarray(np.hypot(gaps[..., 0], gaps[..., 1]).min(axis=1))


def cost_to_go(
    field: NDArray[np.float32],
    resolution_m: float,
    required: float,
    obstacle_weight: float,
    inflation_radius: float,
    goal: int,
) -> Floats:
    """Cost `(rows, cols)` from every cell to the goal, by shortest paths over an explicit graph of neighbours."""
    rows, cols = field.shape[0] // 2, field.shape[1] // 2
    edges = []
    for row in range(rows):
        for col in range(cols):
            for dr, dc in [(0, 1), (0, -1), (1, 0), (-1, 0), (1, 1), (1, -1), (-1, 1), (-1, -1)]:
                r, c = row + dr, col + dc
                if not (0 <= r < rows and 0 <= c < cols):
                    continue
                clearance = field[2 * r + 1, 2 * c + 1] - required
                own = field[2 * row + 1, 2 * col + 1] - required
                between = field[row + r + 1, col + c + 1] - required
                if min(clearance, own, between) >= 0.0:
                    price = (
                        resolution_m
                        * np.hypot(dr, dc)
                        * (1.0 + obstacle_weight * max(0.0, 1.0 - clearance / inflation_radius))
                    )
                    edges.append((row * cols + col, r * cols + c, price))
    start, end, price = np.array(edges).T
    graph = coo_matrix((price, (start.astype(int), end.astype(int))), shape=(rows * cols, rows * cols))
    return np.asarray(dijkstra(graph.tocsr(), indices=goal).reshape(rows, cols))


def travel_time(lengths: Floats, curvatures: Floats, limits: Sequence[float], step_m: float = 2e-4) -> float:
    """Time (s) to drive arcs and lines from rest to rest: the highest speed under all limits, relaxed in small steps.

    `limits` are top speed, lateral acceleration, turn rate, acceleration and deceleration.
    """
    top, lateral, rate, up, down = limits
    caps = np.concatenate(
        [
            np.full(round(length / step_m), min(top, *((math.sqrt(lateral / k), rate / k) if k else (top,))))
            for length, k in zip(lengths, np.abs(curvatures), strict=True)
        ]
    )
    squares = np.minimum(np.r_[caps, caps[-1]], np.r_[caps[0], caps]) ** 2
    squares[0] = squares[-1] = 0.0
    for i in range(1, len(squares)):
        squares[i] = min(squares[i], squares[i - 1] + 2.0 * up * step_m)
    for i in range(len(squares) - 2, -1, -1):
        squares[i] = min(squares[i], squares[i + 1] + 2.0 * down * step_m)
    speeds = np.sqrt(squares)
    return float((2.0 * step_m / (speeds[1:] + speeds[:-1])).sum())
