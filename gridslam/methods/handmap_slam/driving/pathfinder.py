"""The path to an observation point: steepest descent over the drawing, corrected by lidar observations (paper section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.plan_grid import PlanGrid
from gridslam.planning.descent import Inflation, cell_costs, cost_to_go, descend_cost_to_go

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]
Costs = NDArray[np.float32]

OBSTACLE_WEIGHT = 6.0  # extra cost of a metre right beside an obstacle or a drawn wall
MARGIN_M = 0.05  # clearance from observed obstacles beyond the robot's radius
DRAWN_CLEARANCE_CELLS = 0.9  # drawn walls close only their own cells: the lidar shows how wide a door is
MIN_INFLATION_CELLS = 2.0  # radius around drawn walls
GOAL_GROWTH = 2.5  # factor on the radius of a goal around which no cell is free
# Margin beyond the robot's radius of the area around it that is open where it is not solid
FREED_MARGIN_M = 0.15
FREED_COST_FACTOR = 2.0  # cost of that area, in units of the highest cost
FREED_COST = 10.0  # if the whole grid is closed


@dataclass(frozen=True, slots=True)
class FoundPath:
    """A path `(n, 2)` in the robot's frame (m), and its cost (m, higher near obstacles); infinite if there is no path.

    `is_goal_solid`: the goal itself lies in an observed obstacle or a drawn wall.
    """

    path: Floats
    cost_m: float
    is_goal_solid: bool = False

    @staticmethod
    def none(is_goal_solid: bool = False) -> FoundPath:
        """No path."""
        return FoundPath(np.zeros((0, 2)), np.inf, is_goal_solid)


@dataclass(frozen=True, slots=True)
class CostGrid:
    """Cost of crossing each cell of a grid, and the solid cells, which are never entered."""

    grid: PlanGrid
    cell_cost: Costs
    solid: Cells

    def around_robot(self, pose: DrawingPose, radius_m: float) -> CostGrid:
        """The same with the robot's surroundings open: the robot stands there, whatever the distances imply."""
        grid = self.grid
        row, col = grid.cell_of(pose)
        radius = int(np.ceil((radius_m + FREED_MARGIN_M) / grid.cell_m))
        r0, c0 = max(row - radius, 0), max(col - radius, 0)
        window = np.s_[r0 : max(row + radius + 1, r0), c0 : max(col + radius + 1, c0)]
        cell_cost = self.cell_cost.copy()
        part = cell_cost[window]
        finite = cell_cost[np.isfinite(cell_cost)]
        freed_cost = FREED_COST_FACTOR * float(finite.max()) if len(finite) else FREED_COST
        part[~np.isfinite(part) & ~self.solid[window]] = freed_cost
        rows, cols = cell_cost.shape
        if 0 <= row < rows and 0 <= col < cols and not np.isfinite(cell_cost[row, col]):
            cell_cost[row, col] = freed_cost
        return CostGrid(grid, cell_cost, self.solid)


def observed_costs(
    grid: PlanGrid, blocked: Cells, cleared: Cells, radius_m: float, config: ExplorationConfig
) -> Costs:
    """Cost of crossing each cell `(rows, cols)`: by the lidar where it was observed, elsewhere by the drawing.

    Observed surfaces (`blocked`) close everything too narrow for the robot's disc. Drawn walls close only their own cells, and
    none that were observed to be free (`cleared`).
    """
    drawn = (grid.walls | ~grid.free) & ~cleared & ~blocked
    inflation = config.inflation_radius_m / grid.cell_m
    clearance = (radius_m + MARGIN_M) / grid.cell_m
    around_observed = Inflation(clearance, max(inflation, clearance + 1.0), OBSTACLE_WEIGHT)
    around_drawn = Inflation(DRAWN_CLEARANCE_CELLS, max(inflation, MIN_INFLATION_CELLS), OBSTACLE_WEIGHT)
    return np.maximum(
        cell_costs(distances_to(blocked), around_observed), cell_costs(distances_to(drawn), around_drawn)
    )


def find_path(
    costs: CostGrid, pose: DrawingPose, goal_xy: Floats, radius_m: float, arrival_m: float
) -> FoundPath:
    """The path from the robot to within `arrival_m` of a goal `(2,)` (drawing units)."""
    costs = costs.around_robot(pose, radius_m)
    goals = goal_cells(costs, goal_xy, arrival_m)
    if not len(goals):
        return FoundPath.none(is_goal_solid=True)
    return _path_to(costs, pose, goals)


def find_path_to_cells(
    costs: CostGrid, pose: DrawingPose, goals: NDArray[np.int64], radius_m: float
) -> FoundPath:
    """The path from the robot to the nearest of some cells `(k, 2)` (row, col)."""
    return _path_to(costs.around_robot(pose, radius_m), pose, goals)


def _path_to(costs: CostGrid, pose: DrawingPose, goals: NDArray[np.int64]) -> FoundPath:
    grid, cell_cost = costs.grid, costs.cell_cost
    here = grid.cell_of(pose)
    if not (0 <= here[0] < cell_cost.shape[0] and 0 <= here[1] < cell_cost.shape[1]):
        return FoundPath.none()
    cost = cost_to_go(cell_cost, goals, here)
    if not np.isfinite(cost[here]):
        return FoundPath.none()
    x, y = grid.to_cells(np.array([[pose.x, pose.y]]))[0].tolist()
    path = descend_cost_to_go(cost, (x, y))
    return FoundPath(grid.robot_from_cells(path, pose), float(cost[here]) * grid.cell_m)


def goal_cells(costs: CostGrid, goal_xy: Floats, arrival_m: float) -> NDArray[np.int64]:
    """Open cells `(k, 2)` (row, col) near a goal; from a wider circle if there are none."""
    grid, cell_cost = costs.grid, costs.cell_cost
    x, y = grid.to_cells(goal_xy[None])[0].tolist()
    rows, cols = cell_cost.shape
    for radius in (arrival_m / grid.cell_m, GOAL_GROWTH * arrival_m / grid.cell_m):
        r0, r1 = max(int(y - radius), 0), min(int(y + radius) + 2, rows)
        c0, c1 = max(int(x - radius), 0), min(int(x + radius) + 2, cols)
        if r0 >= r1 or c0 >= c1:
            continue
        row, col = np.mgrid[r0:r1, c0:c1]
        near = np.hypot(row + 0.5 - y, col + 0.5 - x) <= max(radius, 1.0)
        near &= np.isfinite(cell_cost[r0:r1, c0:c1])
        if near.any():
            return np.asarray(np.argwhere(near) + np.array([r0, c0]))
    return np.zeros((0, 2), np.int64)
