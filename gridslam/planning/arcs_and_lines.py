"""The path of straight lines and circular arcs that takes the least time (stereo-bayes, paper section 2.5).

1. Rough ways over the cells, from the shortest to ones that shun walls the more, pulled taut.
2. Each leads a search over poses to a first path of Dubins pieces that meets both headings (`kernels/planning_search.py`).
3. Dynamic programming over that path's poses leaves out detours (`kernels/planning_shortcut.py`).
4. The path as a chain of circles joined by tangents descends to less travel time (`kernels/planning_circles.py`).
5. Of all these candidates the one with the least travel time is the plan.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError, MethodError
from gridslam.core.poses import wrap_angle
from gridslam.kernels.planning.circles import parts_are_free
from gridslam.kernels.planning.clearance import pose_clearance
from gridslam.kernels.planning.grid import cost_to_go, descend, pull_taut
from gridslam.kernels.planning.search import EXHAUSTED, FOUND, Query, search_poses
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.planning.footprint import disc
from gridslam.planning.obstacles import OCCUPIED_FROM, ROBOT_RADIUS_M
from gridslam.planning.path import ArcLinePath
from gridslam.planning.refinement import Refiner
from gridslam.planning.refusals import blocked_pose, no_headings, no_way, too_hard
from gridslam.planning.rough_way import spine_of
from gridslam.planning.space import Space, make_space
from gridslam.planning.travel_time import SpeedLimits, time_of, timed_path

Floats = NDArray[np.float64]

DREADS = (0.0, 1.5, 6.0)  # how much dearer a metre right beside an obstacle is
SHY_OF_M = 0.6
BEYOND = 1.3
LEAST_STATES = 100_000
BACK_STATES = 1_000_000
MOST_STATES = 3_000_000
LONG_STEP_M, SHORT_STEP_M = 0.15, 0.05
YAWS, MORE_YAWS = 64, 240
SAME_WAY = 1e-3
SAME_PLACE_M = 1e-6
FREE_YAWS = 8
LEAST_RADIUS_M = 1e-3
HALF_TURN = np.array([0.0, 0.0, np.pi])
SMALLEST_TURN_M = 0.1  # of the search, for robots that turn on the spot


@dataclass(frozen=True, slots=True)
class PlanOptions:
    """The robot and what it may do.

    `discs` `(n, 3)` (x, y, radius) cover its outline and keep `margin_m` off obstacles, which are cells with P >
    `occupied_from` and, if `unknown_blocks`, unknown ones. Arcs have at least `min_radius_m`; 0 stands for turns on the spot
    anywhere, `turn_on_spot` allows them at both ends. With `reverse` it may drive backwards, a change of direction costs
    `reverse_cost_s` in the search.
    """

    discs: Floats = field(default_factory=lambda: disc(ROBOT_RADIUS_M))
    min_radius_m: float = 0.2
    turn_on_spot: bool = False
    reverse: bool = False
    reverse_cost_s: float = 2.0
    margin_m: float = 0.005
    occupied_from: float = OCCUPIED_FROM
    unknown_blocks: bool = True
    limits: SpeedLimits = field(default_factory=SpeedLimits)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.min_radius_m) and self.min_radius_m >= 0.0):
            raise ConfigError(f"smallest radius {self.min_radius_m:g}: expected metres, not negative")
        if not (np.isfinite(self.margin_m) and self.margin_m >= 1e-4):
            raise ConfigError(f"margin {self.margin_m:g}: expected at least 0.0001 m")
        if not 0.0 < self.occupied_from < 1.0:
            raise ConfigError(f"occupied from {self.occupied_from:g}: expected a probability between 0 and 1")
        if self.min_radius_m == 0.0 and not self.turn_on_spot:
            raise ConfigError("smallest radius 0: only a robot that may turn on the spot has none")


@dataclass(frozen=True, slots=True)
class Candidate:
    """One path that was found: what led to it, its length and travel time."""

    name: str
    length_m: float
    time_s: float


@dataclass(frozen=True, slots=True)
class Plan:
    """The path with the least travel time, and what it was chosen from."""

    path: ArcLinePath
    candidates: tuple[Candidate, ...]
    chosen: str


def plan_path(
    occupancy: OccupancyGrid, start: Floats, goal: Floats, options: PlanOptions | None = None
) -> Plan:
    """The path of lines and arcs from `start` to `goal` (x, y, yaw; map frame) that takes the least time found.

    A goal yaw of NaN is free. Raises MethodError, naming what is in the way: a pose is blocked or off the map, obstacles
    separate the two, or their headings cannot be met.
    """
    options = options or PlanOptions()
    space = make_space(
        occupancy, options.discs, options.margin_m, options.occupied_from, options.unknown_blocks
    )
    start_local, goal_local = space.to_local(np.array([start, goal], dtype=np.float64))
    for name, local, pose in (("start", start_local, start), ("goal", goal_local, goal)):
        if not _stands_free(space, local):
            raise blocked_pose(occupancy, space, name, np.asarray(pose, float), local)
    apart = np.nan_to_num(goal_local - start_local)
    if np.hypot(*apart[:2]) < SAME_PLACE_M and abs(wrap_angle(apart[2])) < SAME_PLACE_M:
        raise MethodError("start and goal are the same pose: there is nothing to plan")
    return _Planner(occupancy, space, options, start_local, goal_local).plan()


def _stands_free(space: Space, pose: Floats) -> bool:
    """Whether the robot touches nothing at a pose; with a free yaw (NaN), whether its inner disc does not."""
    world = space.world if np.isfinite(pose[2]) else space.world_of(max(space.inner_radius_m, LEAST_RADIUS_M))
    x, y, yaw = np.nan_to_num(pose)
    return bool(pose_clearance(world, x, y, yaw, 0.0, 0.0) >= 0.0)


class _Planner:
    """One query: the candidates of every rough way."""

    def __init__(
        self, occupancy: OccupancyGrid, space: Space, options: PlanOptions, start: Floats, goal: Floats
    ) -> None:
        self.occupancy, self.space, self.options = occupancy, space, options
        self.start, self.goal = start, goal
        on_spot = options.turn_on_spot
        self.radius_m = max(options.min_radius_m, SMALLEST_TURN_M) if on_spot else options.min_radius_m
        self.needed_m = max(space.inner_radius_m, LEAST_RADIUS_M) + space.margin_m
        self.refiner = Refiner(space, options.min_radius_m, self.radius_m, options.limits)

    def plan(self) -> Plan:
        """The best of all candidates."""
        found: list[tuple[Candidate, Floats]] = []
        apart = self.goal - self.start
        if self.options.turn_on_spot and np.hypot(*apart[:2]) < SAME_PLACE_M:
            self._keep(
                found, "turning on the spot", np.array([[*self.start, 0.0, 0.0, wrap_angle(apart[2])]])
            )
        spines: list[Floats] = []
        for dread in DREADS:
            togo = self._to_go(dread)
            spine = self._spine(togo)
            if any(len(s) == len(spine) and np.abs(s - spine).max() < SAME_WAY for s in spines):
                continue
            spines.append(spine)
            name = "shortest way" if dread == 0.0 else f"shy of walls ({dread:g})"
            for turning in (False, True) if self.options.turn_on_spot else (False,):
                label = f"{name}, turning on the spot" if turning else name
                self._keep(found, label, self._path(togo, spine, turning, is_first=not found))
            if self.options.min_radius_m == 0.0:
                self._keep(found, f"{name}, turning at corners", self._along_corners(spine))
        if not found:
            raise too_hard(self.radius_m, LEAST_STATES)
        best, parts = min(found, key=lambda pair: pair[0].time_s)
        in_map = parts.copy()
        in_map[:, :3] = self.space.to_map(parts[:, :3])
        return Plan(timed_path(in_map, self.options.limits), tuple(c for c, _ in found), best.name)

    def _keep(self, found: list[tuple[Candidate, Floats]], name: str, parts: Floats | None) -> None:
        """Add a candidate, if it is one."""
        if parts is not None and parts_are_free(self.space.world, parts, 0, len(parts)):
            length_m = float(np.abs(parts[:, 3]).sum())
            found.append((Candidate(name, length_m, time_of(parts, self.options.limits)), parts))

    def _along_corners(self, spine: Floats) -> Floats | None:
        """The taut string itself, with turns on the spot and what arcs save."""
        return self.refiner.polyline(spine[:, :2], self.start, self.goal) if len(spine) > 1 else None

    def _to_go(self, dread: float, whole: bool = False, swapped: bool = False) -> NDArray[np.float32]:
        """The cost (m) from the cells that matter, or from the `whole` map, to the goal; `swapped`: to the start.

        Raises MethodError: start and goal are apart.
        """
        space = self.space
        cols = space.blocked.shape[1]
        ends = (self.start, self.goal) if swapped else (self.goal, self.start)
        (row, col), start = (space.nearest_open_cell(pose, self.needed_m) for pose in ends)
        togo: NDArray[np.float32] = cost_to_go(
            space.field,
            space.resolution_m,
            self.needed_m,
            dread,
            SHY_OF_M,
            row * cols + col,
            start[0] * cols + start[1],
            np.inf if whole else BEYOND,
        )
        if not np.isfinite(togo[start]):
            raise no_way(self.occupancy, space, self.options.occupied_from, self.start, self.goal)
        return togo

    def _spine(self, togo: NDArray[np.float32]) -> Floats:
        """Poses along the taut string from start to goal."""
        space = self.space
        row, col = space.nearest_open_cell(self.start, self.needed_m)
        cells = descend(togo, row * togo.shape[1] + col)
        points = np.vstack([self.start[:2], (cells[:, ::-1] + 0.5) * space.resolution_m, self.goal[:2]])
        return spine_of(pull_taut(space.world_of(self.needed_m - space.margin_m), points))

    def _path(self, togo: NDArray[np.float32], spine: Floats, turning: bool, is_first: bool) -> Floats | None:
        """The refined path `(n, 6)` along one rough way; None if there is none, but a MethodError if it is the first."""
        start, goal = self.start.copy(), self.goal.copy()
        if turning:
            start[2], goal[2] = spine[0, 2], spine[-1, 2]
        goals = goal[None]
        if np.isnan(goal[2]):
            around = spine[-1, 2] + 2.0 * np.pi / FREE_YAWS * np.arange(FREE_YAWS)
            goals = np.column_stack([np.tile(goal[:2], (FREE_YAWS, 1)), around])
        motions = self._search(start, goals, spine, togo, is_first and not self.options.turn_on_spot)
        if motions is None or not len(motions):
            return None
        return self.refiner.refine(motions, start, self.start, self.goal)

    def _search(
        self, start: Floats, goals: Floats, spine: Floats, togo: NDArray[np.float32], must: bool
    ) -> Floats | None:
        """Motions `(n, 2)` from the start to one of the goals; None if a short search finds none and it need not.

        A long search is begun only when both ends can be left: a goal whose heading leads out of a wall is found out from
        the goal's side, where few poses can be.
        """
        status, motions, _ = self._search_poses(start, goals, spine, togo, False, LEAST_STATES)
        if status == FOUND or not must:
            return motions if status == FOUND else None
        poses_m = self.space.to_map(np.vstack([self.start, self.goal]))
        radius_m, reverse = self.radius_m, self.options.reverse
        togo = self._to_go(0.0, whole=True)
        if status == EXHAUSTED:  # within the cells that the first search was given
            status, motions, _ = self._search_poses(start, goals, spine, togo, True, LEAST_STATES)
            if status == EXHAUSTED:
                raise no_headings("start", poses_m[0], radius_m, reverse)
        if status != FOUND and len(goals) == 1:
            status, motions, _ = self._search_back(start, goals[0], spine)
            if status == EXHAUSTED:
                raise no_headings("goal", poses_m[1], radius_m, reverse)
        states = 0
        if status != FOUND:
            status, motions, states = self._search_poses(start, goals, spine, togo, False, MOST_STATES)
        if status == EXHAUSTED:
            raise no_headings("start", poses_m[0], radius_m, reverse)
        if status != FOUND:
            raise too_hard(radius_m, states)
        return motions

    def _search_back(self, start: Floats, goal: Floats, spine: Floats) -> tuple[int, Floats, int]:
        """The same search from the goal: with all headings turned round a path is driven the other way, left for right."""
        back = np.stack([goal, start]) + HALF_TURN
        fromgo = self._to_go(0.0, whole=True, swapped=True)
        turned = spine[::-1] + HALF_TURN
        status, motions, states = self._search_poses(
            back[0], back[1][None], turned, fromgo, True, BACK_STATES
        )
        return status, motions[::-1] * [1.0, -1.0], states

    def _search_poses(
        self,
        start: Floats,
        goals: Floats,
        spine: Floats,
        togo: NDArray[np.float32],
        finely: bool,
        most: int,
    ) -> tuple[int, Floats, int]:
        space, options = self.space, self.options
        step_m = max(LONG_STEP_M, 0.5 * self.radius_m)
        query = Query(
            goals=goals,
            spine=spine,
            togo=togo,
            limits=options.limits.for_kernels,
            radius=self.radius_m,
            step=SHORT_STEP_M if finely else step_m,
            bin_size=0.2 * SHORT_STEP_M if finely else 0.5 * step_m,
            bin_yaws=MORE_YAWS if finely else YAWS,
            reverse_cost=options.reverse_cost_s if options.reverse else np.inf,
        )
        status, motions, states = search_poses(space.world, query, start, most)
        return int(status), np.asarray(motions), int(states)
