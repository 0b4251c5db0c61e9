"""Paths by steepest descent on a cost-to-go field with obstacle costs (handmap-slam, paper section 4). Lengths are in cells.

The field comes from fast marching, so that the path is straight in any direction. `motion_search` computes its cost-to-go with
another kernel, by Dijkstra over 8 neighbours: pulling a path taut needs a chain of neighbouring cells with exact clearance, which
a descent between cell centres does not give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.fast_marching import arrival_costs, descend_costs

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

MIN_SPAN = 1e-6  # smallest span of the inflation, against division by zero
MAX_POINTS_PER_SIDE = 4  # largest number of points of a descent, in units of rows + cols
DESCENT_STEP = 0.5  # distance between points of a descent
SEARCH_MARGIN = 20.0  # the front goes on this far beyond the robot, so that gradients around it are known


@dataclass(frozen=True, slots=True)
class Inflation:
    """Costs around obstacles, as in an inflated costmap.

    Cells closer than `min_clearance` to an obstacle are closed. Up to `inflation_radius` the cost falls from 1 +
    `obstacle_weight` to 1.
    """

    min_clearance: float
    inflation_radius: float
    obstacle_weight: float


def cell_costs(distance: NDArray[np.float32], inflation: Inflation) -> NDArray[np.float32]:
    """Cost of crossing each cell `(rows, cols)` by its distance to the nearest obstacle: 1 in the open, infinite if closed."""
    span = max(inflation.inflation_radius - inflation.min_clearance, MIN_SPAN)
    near = np.clip((inflation.inflation_radius - distance) / span, 0.0, 1.0)
    cell_cost = (1.0 + inflation.obstacle_weight * near * near).astype(np.float32)
    cell_cost[distance < inflation.min_clearance] = np.inf
    return np.asarray(cell_cost)


def cost_to_go(
    cell_cost: NDArray[np.float32], goals: NDArray[np.int64], start: tuple[int, int]
) -> NDArray[np.float32]:
    """Cost `(rows, cols)` of each cell to the nearest of the `goals` `(k, 2)` (row, col), up to SEARCH_MARGIN beyond `start`."""
    rows, cols = cell_cost.shape
    flat = np.ravel_multi_index((goals[:, 0], goals[:, 1]), cell_cost.shape).astype(np.int64)
    stop = start[0] * cols + start[1] if 0 <= start[0] < rows and 0 <= start[1] < cols else -1
    return np.asarray(arrival_costs(cell_cost, flat, stop, SEARCH_MARGIN))


def descend_cost_to_go(cost: NDArray[np.float32], start_xy: tuple[float, float]) -> Floats:
    """Path `(n, 2)` (x, y in cells) downhill from a point to where the cost is 0; only the point itself if there is no path."""
    return np.asarray(
        descend_costs(cost, start_xy[0], start_xy[1], DESCENT_STEP, MAX_POINTS_PER_SIDE * sum(cost.shape))
    )
