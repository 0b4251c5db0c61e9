"""What is to be looked at: observation points, their tour, and what has become of each (paper sections 3.1 and 3.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.maps.drawing import DrawnMap
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.plan_grid import PlanGrid, plan_grid
from gridslam.methods.handmap_slam.planning_config import ExplorationConfig
from gridslam.methods.handmap_slam.seen_scans import SeenScan
from gridslam.planning.art_gallery import Gallery, choose_observation_points, gallery_of
from gridslam.planning.descent import Shyness, cost_to_go, prices
from gridslam.planning.tour import plan_tour, way_lengths

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]
Status = Literal["open", "reached", "seen", "unreachable"]

DRAWN_LEAST_CELLS = 0.9


@dataclass(slots=True, eq=False)
class Target:
    """An observation point: `xy` `(2,)` in drawing metres, the walls it is to see `(n,)`, and what became of it.

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
    """All observation points and the order in which those still open are visited."""

    grid: PlanGrid
    gallery: Gallery
    targets: list[Target]
    uncoverable: Cells  # walls that no candidate sees
    lengths: Floats  # ways between the points (k, k), metres
    price: NDArray[np.float32]
    reach_cells: float
    seen: Cells
    config: ExplorationConfig
    rng: np.random.Generator
    tour: list[int] = field(default_factory=list)
    settled: int = 0

    @property
    def coverable(self) -> Cells:
        """Walls that some candidate sees `(n,)`."""
        return ~self.uncoverable

    def wall_cells(self, which: Cells) -> NDArray[np.int64]:
        """Cells `(k, 2)` (row, col) of the plan's grid of some of the walls."""
        return np.column_stack(np.unravel_index(self.gallery.cells[which], self.grid.walls.shape))

    @property
    def current(self) -> Target | None:
        """The point to be visited next."""
        return self.targets[self.tour[0]] if self.tour else None

    def look(self, scan: SeenScan, pose: DrawingPose, stamp_ns: int) -> None:
        """Note the walls that the scan has looked at from a pose; points with nothing left to see are settled."""
        self.seen |= self._looked_at(scan, pose) & self.coverable
        share = self.config.observation.seen_share
        for index in list(self.tour):
            target = self.targets[index]
            if int((target.walls & self.seen).sum()) >= share * int(target.walls.sum()):
                self.settle(index, "seen", stamp_ns)

    def settle(self, index: int, status: Status, stamp_ns: int, reason: str = "") -> None:
        """Close a point."""
        target = self.targets[index]
        self.settled += 1
        target.status, target.reason, target.order, target.stamp_ns = status, reason, self.settled, stamp_ns
        self.tour.remove(index)

    def give_up(self, reason: str, stamp_ns: int) -> None:
        """The current point cannot be reached: unreachable, or put off to the end of the tour while tries are left."""
        index = self.tour[0]
        target = self.targets[index]
        target.tries += 1
        if target.tries >= self.config.patience.tries or len(self.tour) == 1:
            self.settle(index, "unreachable", stamp_ns, reason)
            return
        target.reason = reason
        self.tour.append(self.tour.pop(0))

    def order_from(self, pose: DrawingPose) -> None:
        """Plan the tour over the open points from where the robot is; those tried before come last."""
        fresh = [i for i in self.tour if self.targets[i].tries == 0]
        later = [i for i in self.tour if self.targets[i].tries > 0]
        if len(fresh) < 2:
            self.tour = fresh + later
            return
        here = self.grid.cell_of(pose)
        cells = np.array([self._cell(i) for i in fresh])
        rows, cols = self.price.shape
        if 0 <= here[0] < rows and 0 <= here[1] < cols:
            cost = cost_to_go(_passable_at(self.price, here), np.array([here]), (-1, -1))
            first = cost[cells[:, 0], cells[:, 1]].astype(np.float64)
        else:
            first = np.hypot(*(cells - here).T).astype(np.float64)
        table = np.zeros((len(fresh) + 1, len(fresh) + 1))
        table[0, 1:] = table[1:, 0] = first
        table[1:, 1:] = self.lengths[np.ix_(fresh, fresh)]
        order = plan_tour(table, self.rng)
        self.tour = [fresh[k - 1] for k in order[1:]] + later

    def _cell(self, index: int) -> NDArray[np.int64]:
        x, y = self.grid.to_cells(self.targets[index].xy[None])[0]
        return np.array([int(y), int(x)])

    def _looked_at(self, scan: SeenScan, pose: DrawingPose) -> Cells:
        """Walls drawn in sight of the pose, in whose direction a beam went as far as they are drawn, less a tolerance."""
        at = self.grid.to_cells(np.array([[pose.x_m, pose.y_m]]))
        visible = self.gallery.seen_from(at, self.reach_cells)[0]
        places = self.grid.to_drawing(
            np.asarray(self.wall_cells(np.ones_like(visible))[:, ::-1] + 0.5, np.float64)
        )
        towards = pose.from_drawing(places)
        away = np.hypot(towards[:, 0], towards[:, 1])
        beams = scan.ends - scan.origin
        bearings = np.arctan2(beams[:, 1], beams[:, 0])
        if not len(bearings):
            return np.zeros_like(visible)
        order = np.argsort(bearings, kind="stable")
        wanted = np.arctan2(towards[:, 1], towards[:, 0])
        nearest = np.searchsorted(bearings[order], wanted) % len(order)
        lengths = np.hypot(beams[:, 0], beams[:, 1])[order]
        return np.asarray(visible & (lengths[nearest] >= away - self.config.observation.agreement_m))


def plan_observation(
    drawn: DrawnMap, pose: DrawingPose, radius_m: float, config: ExplorationConfig, rng: np.random.Generator
) -> ObservationPlan:
    """Choose the observation points at the present scale, and their tour from the present pose."""
    grid = plan_grid(drawn, pose.scale_x, pose.scale_y, config.path.cell_m)
    distance = distances_to(~grid.free)
    wished = config.path.wished_m / grid.cell_m
    price = prices(distance, Shyness(DRAWN_LEAST_CELLS, max(wished, 2.0), config.path.dread))
    here = _nearest_passable(price, grid.cell_of(pose))
    reached = np.isfinite(cost_to_go(price, np.array([here]), (-1, -1)))
    standable = reached & (distance >= max(config.observation.wall_distance_m, radius_m) / grid.cell_m)
    if not standable.any():  # everything is narrow: as far off the walls as it goes
        standable = reached & (distance >= 0.5 * float(distance[reached].max()))
    gallery = gallery_of(grid.walls, grid.free)
    reach = config.observation.range_m / grid.cell_m
    # the robot stops short of a point by the arrival distance and must see from there what the point was chosen for
    near = max(reach - config.observation.arrival_m / grid.cell_m, 1.0)
    points = choose_observation_points(gallery, standable, near, config.observation.candidates, rng)
    cells = points.points[:, ::-1].astype(np.int64)
    plan = ObservationPlan(
        grid,
        gallery,
        [Target(xy, walls) for xy, walls in zip(grid.to_drawing(points.points), points.sees, strict=True)],
        points.uncoverable,
        way_lengths(price, cells),
        price,
        reach,
        np.zeros(len(gallery.cells), np.bool_),
        config,
        rng,
        list(range(len(points.points))),
    )
    plan.order_from(pose)
    return plan


def _nearest_passable(price: NDArray[np.float32], here: tuple[int, int]) -> NDArray[np.int64]:
    cells = np.argwhere(np.isfinite(price))
    return np.asarray(cells[np.argmin(((cells - here) ** 2).sum(axis=1))])


def _passable_at(price: NDArray[np.float32], here: tuple[int, int]) -> NDArray[np.float32]:
    """The prices, with a way from a robot that stands on a drawn wall to the nearest passable cell."""
    if np.isfinite(price[here]):
        return price
    near = _nearest_passable(price, here)
    count = int(np.abs(near - here).sum()) * 2 + 2
    rows, cols = np.rint(np.linspace(here, near, count)).astype(np.int64).T
    price = price.copy()
    price[rows, cols] = np.minimum(price[rows, cols], 10.0)
    # a front over the sides of cells needs a way without diagonal steps
    price[rows[1:], cols[:-1]] = np.minimum(price[rows[1:], cols[:-1]], 10.0)
    return price
