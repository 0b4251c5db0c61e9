"""Observation points, the tour over them, and the status of each (paper sections 3.1 and 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.pathfinder import (
    DRAWN_CLEARANCE_CELLS,
    MIN_INFLATION_CELLS,
    OBSTACLE_WEIGHT,
)
from gridslam.methods.handmap_slam.driving.plan_grid import PlanGrid, plan_grid
from gridslam.methods.handmap_slam.scan_memory import BeamEndpoints
from gridslam.planning.art_gallery import Gallery, choose_observation_points, gallery_of
from gridslam.planning.descent import Inflation, cell_costs, cost_to_go
from gridslam.planning.tour import path_costs, plan_tour

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]
Costs = NDArray[np.float32]
Status = Literal["open", "reached", "seen", "unreachable"]

CANDIDATES = 500  # places scattered over the free space, from which observation points are chosen
WALL_DISTANCE_M = 0.6  # smallest distance between observation points and drawn walls
NARROW_RATIO = 0.5  # fraction of the largest distance to a wall, where no place is WALL_DISTANCE_M from them
ARRIVAL_M = 0.4  # an observation point this close is reached
SEEN_RATIO = 0.97  # fraction of a point's walls that, observed from elsewhere, makes a visit unnecessary
RANGE_TOLERANCE_M = 0.6  # a drawn wall is observed if the beam towards it is at most this much shorter
# Largest number of visits to a point that was given up; the second one is at the end of the tour
MAX_TRIES = 2
BRIDGE_COST = 10.0  # cost of a drawn wall's cell under the robot
UNLIMITED = (-1, -1)  # start of a cost-to-go that covers the whole grid


@dataclass(slots=True, eq=False)
class ObservationTarget:
    """An observation point: `xy` `(2,)` in drawing units, the walls assigned to it `(n,)`, and its status.

    `order` counts the points in the order in which they were settled, from 1.
    """

    xy: Floats
    walls: Cells
    status: Status = "open"
    reason: str = ""
    tries: int = 0
    order: int = 0
    stamp_ns: int = 0


@dataclass(slots=True, eq=False)
class ObservationPlan:
    """All observation points, and the order in which those still open are visited.

    grid: The drawing in cells that are square in the world.
    gallery: The walls of the grid, as targets of visibility queries.
    targets: The observation points.
    uncoverable: Walls `(n,)` visible from no candidate.
    path_costs: Costs `(k, k)` of the paths between the points.
    cell_cost: Cost `(rows, cols)` of crossing each cell.
    seen: Walls `(n,)` observed so far.
    tour: Indices of the open points in the order of their visits.
    settled: Number of points that are no longer open.
    """

    grid: PlanGrid
    gallery: Gallery
    targets: list[ObservationTarget]
    uncoverable: Cells
    path_costs: Floats
    cell_cost: Costs
    view_range_cells: float
    rng: np.random.Generator
    seen: Cells
    tour: list[int] = field(default_factory=list)
    settled: int = 0

    @property
    def coverable(self) -> Cells:
        """Walls `(n,)` visible from some candidate."""
        return ~self.uncoverable

    @property
    def current(self) -> ObservationTarget | None:
        """The point to visit next."""
        return self.targets[self.tour[0]] if self.tour else None

    def add_scan(self, scan: BeamEndpoints, pose: DrawingPose, stamp_ns: int) -> None:
        """Mark the walls that the scan observes from a pose, and settle points with no walls left."""
        self.seen |= self._observed_by(scan, pose) & self.coverable
        for index in list(self.tour):
            target = self.targets[index]
            if int((target.walls & self.seen).sum()) >= SEEN_RATIO * int(target.walls.sum()):
                self.settle(index, "seen", stamp_ns)

    def settle(self, index: int, status: Status, stamp_ns: int, reason: str = "") -> None:
        """Close a point."""
        target = self.targets[index]
        self.settled += 1
        target.status, target.reason, target.order, target.stamp_ns = status, reason, self.settled, stamp_ns
        self.tour.remove(index)

    def give_up(self, reason: str, stamp_ns: int) -> None:
        """Close the current point as unreachable, or move it to the end of the tour while it has tries left."""
        index = self.tour[0]
        target = self.targets[index]
        target.tries += 1
        if target.tries >= MAX_TRIES or len(self.tour) == 1:
            self.settle(index, "unreachable", stamp_ns, reason)
            return
        target.reason = reason
        self.tour.append(self.tour.pop(0))

    def plan_tour_from(self, pose: DrawingPose) -> None:
        """Plan the tour over the open points from the robot's pose; points tried before come last."""
        fresh = [i for i in self.tour if self.targets[i].tries == 0]
        tried = [i for i in self.tour if self.targets[i].tries > 0]
        if len(fresh) < 2:
            self.tour = fresh + tried
            return
        here = self.grid.cell_of(pose)
        cells = np.array([self._cell(i) for i in fresh])
        rows, cols = self.cell_cost.shape
        if 0 <= here[0] < rows and 0 <= here[1] < cols:
            cost = cost_to_go(_open_at(self.cell_cost, here), np.array([here]), UNLIMITED)
            from_robot = cost[cells[:, 0], cells[:, 1]].astype(np.float64)
        else:
            from_robot = np.hypot(*(cells - here).T).astype(np.float64)
        table = np.zeros((len(fresh) + 1, len(fresh) + 1))
        table[0, 1:] = table[1:, 0] = from_robot
        table[1:, 1:] = self.path_costs[np.ix_(fresh, fresh)]
        order = plan_tour(table, self.rng)
        self.tour = [fresh[k - 1] for k in order[1:]] + tried

    def _cell(self, index: int) -> NDArray[np.int64]:
        x, y = self.grid.to_cells(self.targets[index].xy[None])[0]
        return np.array([int(y), int(x)])

    def _observed_by(self, scan: BeamEndpoints, pose: DrawingPose) -> Cells:
        """Walls `(n,)` visible from the pose in the drawing, towards which a beam goes as far as they are drawn, or almost."""
        at = self.grid.to_cells(np.array([[pose.x, pose.y]]))
        visible = self.gallery.visible_from(at, self.view_range_cells)[0]
        if not len(scan.endpoints):
            return np.zeros_like(visible)
        rows, cols = np.unravel_index(self.gallery.cells, self.grid.walls.shape)
        walls = self.grid.robot_from_cells(np.asarray(np.column_stack([cols, rows]) + 0.5, np.float64), pose)
        distances = np.hypot(walls[:, 0], walls[:, 1])
        beams = scan.endpoints - scan.origin
        bearings = np.arctan2(beams[:, 1], beams[:, 0])
        order = np.argsort(bearings, kind="stable")
        nearest = np.searchsorted(bearings[order], np.arctan2(walls[:, 1], walls[:, 0])) % len(order)
        lengths = np.hypot(beams[:, 0], beams[:, 1])[order]
        return np.asarray(visible & (lengths[nearest] >= distances - RANGE_TOLERANCE_M))


def plan_observation(
    drawn: DrawnMap, pose: DrawingPose, radius_m: float, config: ExplorationConfig, rng: np.random.Generator
) -> ObservationPlan:
    """Choose the observation points at the current scale, and plan the tour from the current pose."""
    grid = plan_grid(drawn, pose.scale_x, pose.scale_y)
    distance = distances_to(~grid.free)
    inflation = max(config.inflation_radius_m / grid.cell_m, MIN_INFLATION_CELLS)
    cell_cost = cell_costs(distance, Inflation(DRAWN_CLEARANCE_CELLS, inflation, OBSTACLE_WEIGHT))
    here = _nearest_open(cell_cost, grid.cell_of(pose))
    reachable = np.isfinite(cost_to_go(cell_cost, np.array([here]), UNLIMITED))
    standable = reachable & (distance >= max(WALL_DISTANCE_M, radius_m) / grid.cell_m)
    if not standable.any():
        standable = reachable & (distance >= NARROW_RATIO * float(distance[reachable].max()))
    gallery = gallery_of(grid.walls, grid.free)
    view_range = config.view_range_m / grid.cell_m
    # The robot stops up to the arrival distance from a point, and must see the point's walls from there.
    from_arrival = max(view_range - ARRIVAL_M / grid.cell_m, 1.0)
    points = choose_observation_points(gallery, standable, from_arrival, CANDIDATES, rng)
    positions = grid.to_drawing(points.points)
    plan = ObservationPlan(
        grid=grid,
        gallery=gallery,
        targets=[ObservationTarget(xy, w) for xy, w in zip(positions, points.visible, strict=True)],
        uncoverable=points.uncoverable,
        path_costs=path_costs(cell_cost, points.points[:, ::-1].astype(np.int64)),
        cell_cost=cell_cost,
        view_range_cells=view_range,
        rng=rng,
        seen=np.zeros(len(gallery.cells), np.bool_),
        tour=list(range(len(points.points))),
    )
    plan.plan_tour_from(pose)
    return plan


def _nearest_open(cell_cost: Costs, here: tuple[int, int]) -> NDArray[np.int64]:
    """The open cell (row, col) nearest to a cell."""
    cells = np.argwhere(np.isfinite(cell_cost))
    return np.asarray(cells[np.argmin(((cells - here) ** 2).sum(axis=1))])


def _open_at(cell_cost: Costs, here: tuple[int, int]) -> Costs:
    """The costs, with a bridge from a robot on a drawn wall to the nearest open cell."""
    if np.isfinite(cell_cost[here]):
        return cell_cost
    near = _nearest_open(cell_cost, here)
    count = int(np.abs(near - here).sum()) * 2 + 2
    rows, cols = np.rint(np.linspace(here, near, count)).astype(np.int64).T
    cell_cost = cell_cost.copy()
    cell_cost[rows, cols] = np.minimum(cell_cost[rows, cols], BRIDGE_COST)
    # The front of fast marching passes through sides of cells, so the bridge must have no diagonal steps.
    cell_cost[rows[1:], cols[:-1]] = np.minimum(cell_cost[rows[1:], cols[:-1]], BRIDGE_COST)
    return cell_cost
