"""The path to an observation point: steepest descent over the drawing as the lidar corrects it (paper section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.plan_grid import PlanGrid
from gridslam.methods.handmap_slam.planning_config import PathConfig
from gridslam.planning.descent import Shyness, cost_to_go, prices, steepest_way

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

WIDER = 2.5  # where no cell about a goal is free, the goal grows by this once
DRAWN_LEAST_CELLS = 0.9  # drawn walls close their own cells alone: how wide a door is, the lidar tells


@dataclass(frozen=True, slots=True)
class FoundPath:
    """The way `(n, 2)` in the robot's frame (m), and its cost (metres, more near obstacles); infinite: every way is closed.

    `is_walled`: the goal itself lies in what is seen to be solid.
    """

    way: Floats
    cost_m: float
    is_walled: bool = False


def passable_prices(
    grid: PlanGrid, blocked: Cells, cleared: Cells, radius_m: float, config: PathConfig
) -> NDArray[np.float32]:
    """What each cell's width costs `(rows, cols)`, by the drawing where nothing was seen, by the lidar where it was.

    Surfaces seen close what the robot's disc does not fit between; drawn ones close only themselves, and where they are seen
    through nothing.
    """
    drawn = (grid.walls | ~grid.free) & ~cleared & ~blocked
    dread, wished = config.dread, config.wished_m / grid.cell_m
    least = (radius_m + config.margin_m) / grid.cell_m
    seen = prices(distances_to(blocked), Shyness(least, max(wished, least + 1.0), dread))
    sketched = prices(distances_to(drawn), Shyness(DRAWN_LEAST_CELLS, max(wished, 2.0), dread))
    return np.maximum(seen, sketched)


def find_path(
    grid: PlanGrid,
    price: NDArray[np.float32],
    solid: Cells,
    pose: DrawingPose,
    goal_xy: Floats,
    radius_m: float,
    arrival_m: float,
) -> FoundPath:
    """The way from the robot to within `arrival_m` of a goal (drawing metres) over prices; `solid` cells are never entered."""
    price = _with_room_for_robot(grid, price, solid, pose, radius_m)
    goals = goal_cells(grid, price, goal_xy, arrival_m)
    if not len(goals):
        return FoundPath(np.zeros((0, 2)), np.inf, is_walled=True)
    return _way_to(grid, price, pose, goals)


def find_path_to_cells(
    grid: PlanGrid,
    price: NDArray[np.float32],
    solid: Cells,
    pose: DrawingPose,
    goals: NDArray[np.int64],
    radius_m: float,
) -> FoundPath:
    """The way from the robot to the nearest of some cells `(k, 2)` (row, col) over prices; `solid` cells are never entered."""
    return _way_to(grid, _with_room_for_robot(grid, price, solid, pose, radius_m), pose, goals)


def _way_to(
    grid: PlanGrid, price: NDArray[np.float32], pose: DrawingPose, goals: NDArray[np.int64]
) -> FoundPath:
    here = grid.cell_of(pose)
    none = np.zeros((0, 2))
    if not (0 <= here[0] < price.shape[0] and 0 <= here[1] < price.shape[1]):
        return FoundPath(none, np.inf)
    cost = cost_to_go(price, goals, here)
    if not np.isfinite(cost[here]):
        return FoundPath(none, np.inf)
    x, y = grid.to_cells(np.array([[pose.x_m, pose.y_m]]))[0].tolist()
    way = steepest_way(cost, (x, y))
    return FoundPath(grid.robot_from_cells(way, pose), float(cost[here]) * grid.cell_m)


def goal_cells(
    grid: PlanGrid, price: NDArray[np.float32], goal_xy: Floats, arrival_m: float
) -> NDArray[np.int64]:
    """Passable cells `(k, 2)` (row, col) near a goal; from a wider circle when there is none."""
    x, y = grid.to_cells(goal_xy[None])[0].tolist()
    rows, cols = price.shape
    for reach in (arrival_m / grid.cell_m, WIDER * arrival_m / grid.cell_m):
        r0, r1 = max(int(y - reach), 0), min(int(y + reach) + 2, rows)
        c0, c1 = max(int(x - reach), 0), min(int(x + reach) + 2, cols)
        if r0 >= r1 or c0 >= c1:
            continue
        row, col = np.mgrid[r0:r1, c0:c1]
        near = np.hypot(row + 0.5 - y, col + 0.5 - x) <= max(reach, 1.0)
        near &= np.isfinite(price[r0:r1, c0:c1])
        if near.any():
            return np.asarray(np.argwhere(near) + np.array([r0, c0]))
    return np.zeros((0, 2), np.int64)


def _with_room_for_robot(
    grid: PlanGrid, price: NDArray[np.float32], solid: Cells, pose: DrawingPose, radius_m: float
) -> NDArray[np.float32]:
    """The prices with the robot's own place passable: it stands there, whatever the distances say."""
    row, col = grid.cell_of(pose)
    reach = int(np.ceil((radius_m + 0.15) / grid.cell_m))
    r0, c0 = max(row - reach, 0), max(col - reach, 0)
    window = np.s_[r0 : max(row + reach + 1, r0), c0 : max(col + reach + 1, c0)]
    price = price.copy()
    part = price[window]
    finite = price[np.isfinite(price)]
    dear = 2.0 * float(finite.max()) if len(finite) else 10.0
    part[~np.isfinite(part) & ~solid[window]] = dear
    rows, cols = price.shape
    if 0 <= row < rows and 0 <= col < cols and not np.isfinite(price[row, col]):
        price[row, col] = dear
    return price
