"""The path of straight lines and circular arcs with the shortest travel time (stereo-bayes, paper section 2.5).

1. Guide paths are found over the cells and pulled taut: the shortest one, and others that keep farther from walls.
2. Along each of them, a search over poses finds a path of arcs and lines that starts and ends with the required headings
   (`motion_search.py`).
3. Dynamic programming over the poses of that path removes detours (`kernels/planning/shortcut.py`).
4. The path becomes a chain of circles joined by tangents; a local search over them shortens the travel time
   (`kernels/planning/circles.py`).
5. The candidate with the shortest travel time is the plan.

A path is computed as an array of parts `(n, 6)`: lines, arcs, and turns on the spot. `kernels/planning/drive_limits.py` names the
columns: pose (m, m, rad) at the start of the part, length (m, negative backwards), curvature (1/m), and angle of a turn (rad).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.core.poses import wrap_angle
from gridslam.kernels.planning.circles import parts_are_free
from gridslam.kernels.planning.clearance import pose_clearance
from gridslam.kernels.planning.drive_limits import LENGTH
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.planning.large_maps import MAX_CELLS, coarsened, window_around
from gridslam.planning.motion_search import LARGE_MAP_STATES, Costs, MotionSearch, Report, no_report
from gridslam.planning.options import PlanOptions
from gridslam.planning.path import ArcLinePath
from gridslam.planning.refinement import Refiner
from gridslam.planning.refusals import blocked_pose, search_limit_reached
from gridslam.planning.space import MIN_DISC_RADIUS_M, Space, make_space
from gridslam.planning.travel_time import timed_path, travel_time_of

Floats = NDArray[np.float64]

logger = logging.getLogger(__name__)

# Extra cost of a metre right beside an obstacle; each weight gives one guide path
OBSTACLE_WEIGHTS = (0.0, 1.5, 6.0)
SAME_GUIDE_PATH_M = 1e-3  # guide paths whose poses differ by less (m, rad) are the same
SAME_PLACE_M = 1e-6
# To bound the time of a plan, a longer guide path gets one candidate only, with one pass of improvement, or without any
LONG_PATH_M = 500.0
VERY_LONG_PATH_M = 1000.0
# Motions of a long path improved together. Compared with 120, planning takes a third of the time, and driving 2 % more
LONG_PATH_MOTIONS = 40
GOAL_YAWS = 8  # headings tried at a goal whose yaw is free


@dataclass(frozen=True, slots=True)
class PathCandidate:
    """The name, length and travel time of a path that was found."""

    name: str
    length_m: float
    time_s: float


@dataclass(frozen=True, slots=True)
class PlannedPath:
    """The path with the shortest travel time, the candidates it was chosen from, and the name of the chosen one."""

    path: ArcLinePath
    candidates: tuple[PathCandidate, ...]
    chosen: str


def plan_path(
    occupancy: OccupancyGrid,
    start: Floats,
    goal: Floats,
    options: PlanOptions | None = None,
    report: Report = no_report,
) -> PlannedPath:
    """The fastest path of lines and arcs found between two poses `(3,)` (x, y, yaw; m, rad; map frame).

    A goal yaw of NaN is free. `report` is called several times a second with the number of poses that the current search has
    found. In a map with more than `large_maps.MAX_CELLS` cells, the path is planned in a window around start and goal and,
    if there is no path in it, in the whole map with larger cells.

    Raises MethodError, which names the cause: start or goal is blocked or off the map, obstacles separate them, or the robot
    cannot reach a heading.
    """
    options = options or PlanOptions()
    start, goal = np.asarray(start, dtype=np.float64), np.asarray(goal, dtype=np.float64)
    plan_in = partial(_plan_in, start=start, goal=goal, options=options, report=report)
    if occupancy.probability.size <= MAX_CELLS:
        return plan_in(occupancy)
    window = window_around(occupancy, start, goal)
    if window is not None:
        try:
            return plan_in(window, max_states=LARGE_MAP_STATES)
        except MethodError as error:
            logger.info("no path in the window around start and goal: %s", error)
    coarse = coarsened(occupancy, options.occupied_from)
    try:
        return plan_in(coarse, max_states=LARGE_MAP_STATES)
    except MethodError as error:
        raise MethodError(
            f"{error} (planned in cells of {coarse.geometry.resolution_m:g} m, because the map has more than {MAX_CELLS} cells; "
            "crop the map to plan in its own cells)"
        ) from None


def _plan_in(
    occupancy: OccupancyGrid,
    start: Floats,
    goal: Floats,
    options: PlanOptions,
    report: Report,
    max_states: float = np.inf,
) -> PlannedPath:
    """`plan_path` in a map of any size, with at most `max_states` poses in all searches together."""
    space = make_space(
        occupancy, options.discs, options.margin_m, options.occupied_from, options.unknown_blocks
    )
    start_local, goal_local = space.to_local(np.array([start, goal]))
    for name, local, pose in (("start", start_local, start), ("goal", goal_local, goal)):
        if not _is_pose_free(space, local):
            raise blocked_pose(occupancy, space, name, pose, local)
    difference = np.nan_to_num(goal_local - start_local)
    if np.hypot(*difference[:2]) < SAME_PLACE_M and abs(wrap_angle(difference[2])) < SAME_PLACE_M:
        raise MethodError("start and goal are the same pose: there is nothing to plan")
    search = MotionSearch(
        occupancy, space, options, start_local, goal_local, report=report, max_states=max_states
    )
    return _PathPlanner(search, space, options, start_local, goal_local).plan()


def _is_pose_free(space: Space, pose: Floats) -> bool:
    """Whether the robot keeps its margin at a pose in the space's frame; with a free yaw (NaN), whether its inner disc does."""
    radius_m = max(space.inner_radius_m, MIN_DISC_RADIUS_M)
    world = space.world if np.isfinite(pose[2]) else space.world_for_disc(radius_m)
    x, y, yaw = np.nan_to_num(pose)
    return bool(pose_clearance(world, x, y, yaw, forward=1.0, rotation=0.0) >= 0.0)


class _PathPlanner:
    """Collects the candidates along every guide path between two poses `(3,)` in the frame of `space`."""

    def __init__(
        self, search: MotionSearch, space: Space, options: PlanOptions, start: Floats, goal: Floats
    ) -> None:
        self.search = search
        self.space, self.options = space, options
        self.start, self.goal = start, goal
        self.refiner = Refiner(space, options.min_radius_m, self.search.radius_m, options.limits)
        self.found: list[tuple[PathCandidate, Floats]] = []

    def plan(self) -> PlannedPath:
        """The fastest of all candidates. Raises MethodError if there is none."""
        difference = self.goal - self.start
        if self.options.turn_on_spot and np.hypot(*difference[:2]) < SAME_PLACE_M:
            turn_on_spot_alone = np.array([[*self.start, 0.0, 0.0, wrap_angle(difference[2])]])
            self._keep("turning on the spot", turn_on_spot_alone)
        guide_paths: list[Floats] = []
        for weight in OBSTACLE_WEIGHTS:
            cost = self.search.cost_to_go(weight)
            guide_path = self.search.guide_path(cost)
            if not any(_is_same(guide_path, other) for other in guide_paths):
                guide_paths.append(guide_path)
                name = "shortest path" if weight == 0.0 else f"away from walls (weight {weight:g})"
                self._keep_along(name, guide_path, cost)
            if self.found and _is_long(guide_path):
                break
        if not self.found:
            raise search_limit_reached(self.search.radius_m, self.search.states)
        best, parts = min(self.found, key=lambda pair: pair[0].time_s)
        in_map = parts.copy()
        in_map[:, :3] = self.space.to_map(parts[:, :3])
        path = timed_path(in_map, self.options.limits)
        return PlannedPath(path, tuple(candidate for candidate, _ in self.found), best.name)

    def _keep_along(self, name: str, guide_path: Floats, cost: Costs) -> None:
        """Add the candidates along one guide path."""
        for turns_on_spot in (False, True) if self.options.turn_on_spot else (False,):
            label = f"{name}, turning on the spot" if turns_on_spot else name
            self._keep(label, self._path(cost, guide_path, turns_on_spot, is_first=not self.found))
            if self.found and _is_long(guide_path):
                return
        if self.options.min_radius_m == 0.0 and len(guide_path) > 1:
            corners = self.refiner.along_polyline(guide_path[:, :2], self.start, self.goal)
            self._keep(f"{name}, turning at corners", corners)

    def _keep(self, name: str, parts: Floats | None) -> None:
        """Add a path of parts `(n, 6)` to the candidates if it is free."""
        if parts is not None and parts_are_free(self.space.world, parts, 0, len(parts)):
            length_m = float(np.abs(parts[:, LENGTH]).sum())
            candidate = PathCandidate(name, length_m, travel_time_of(parts, self.options.limits))
            self.found.append((candidate, parts))

    def _path(self, cost: Costs, guide_path: Floats, turns_on_spot: bool, is_first: bool) -> Floats | None:
        """The refined path `(n, 6)` along a guide path, with or without turns on the spot at its ends; None if none is found.

        If `is_first` and the robot may not turn on the spot, no other candidate may follow: MethodError is raised with the cause.
        """
        start, goal = self.start.copy(), self.goal.copy()
        if turns_on_spot:
            start[2], goal[2] = guide_path[0, 2], guide_path[-1, 2]
        goals = goal[None]
        if np.isnan(goal[2]):
            yaws = guide_path[-1, 2] + 2.0 * np.pi / GOAL_YAWS * np.arange(GOAL_YAWS)
            goals = np.column_stack([np.tile(goal[:2], (GOAL_YAWS, 1)), yaws])
        is_required = is_first and not self.options.turn_on_spot
        motions = self.search.motions(start, goals, guide_path, cost, is_required)
        if motions is None or not len(motions):
            return None
        refiner = self.refiner
        if _is_long(guide_path):
            passes = 0 if _length_m(guide_path) > VERY_LONG_PATH_M else 1
            refiner = replace(refiner, passes=passes, max_motions=LONG_PATH_MOTIONS)
        return refiner.refine(motions, start, self.start, self.goal)


def _is_long(guide_path: Floats) -> bool:
    """Whether a guide path `(n, 3)` is so long that it gets one candidate only."""
    return _length_m(guide_path) > LONG_PATH_M


def _length_m(guide_path: Floats) -> float:
    """Length of a guide path `(n, 3)`."""
    return float(np.hypot(*np.diff(guide_path[:, :2], axis=0).T).sum())


def _is_same(one: Floats, other: Floats) -> bool:
    return len(one) == len(other) and float(np.abs(one - other).max()) < SAME_GUIDE_PATH_M
