"""Ways by steepest descent on a cost-to-go field with clearance (handmap-slam, paper section 4). Lengths are cells.

The field is that of fast marching, so that the way runs straight in any direction. `arcs_and_lines` has another kernel for a
cost-to-go: it needs a chain of neighbouring cells with room for the robot, exact to the corner of a cell, which is then pulled
taut; Dijkstra over 8 neighbours gives the chain, a descent between cells does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.fast_marching import arrival_costs, descend_costs

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

STEP = 0.5  # of the descent
SLACK = 20.0  # the front goes on for so long after it has reached the robot, so that the descent has room


@dataclass(frozen=True, slots=True)
class Shyness:
    """Where the robot passes: not nearer than `least` to what blocks, and dearer up to 1 + `dread` when nearer than `wished`."""

    least: float
    wished: float
    dread: float


def prices(distance: NDArray[np.float32], shyness: Shyness) -> NDArray[np.float32]:
    """The cost of each cell's width `(rows, cols)`: 1 in the open, more near obstacles, infinite where the robot does not fit."""
    span = max(shyness.wished - shyness.least, 1e-6)
    near = np.clip((shyness.wished - distance) / span, 0.0, 1.0)
    price = (1.0 + shyness.dread * near * near).astype(np.float32)
    price[distance < shyness.least] = np.inf
    return np.asarray(price)


def cost_to_go(
    price: NDArray[np.float32], goals: NDArray[np.int64], start: tuple[int, int]
) -> NDArray[np.float32]:
    """Cost `(rows, cols)` from everywhere to the nearest of the goal cells `(k, 2)` (row, col), as far out as the start."""
    rows, cols = price.shape
    flat = np.ravel_multi_index((goals[:, 0], goals[:, 1]), price.shape).astype(np.int64)
    stop = start[0] * cols + start[1] if 0 <= start[0] < rows and 0 <= start[1] < cols else -1
    return np.asarray(arrival_costs(price, flat, stop, SLACK))


def steepest_way(cost: NDArray[np.float32], start_xy: tuple[float, float]) -> Floats:
    """The way `(n, 2)` (x, y) from a point downhill to where the cost is 0; only the point itself if nothing leads on."""
    return np.asarray(descend_costs(cost, start_xy[0], start_xy[1], STEP, 4 * sum(cost.shape)))
