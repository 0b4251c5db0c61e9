"""From a start to a goal pose: the guide path over the cells, and drivable motions along it."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.grid import cost_to_go, descend, pull_string
from gridslam.kernels.planning.search import (
    EXHAUSTED,
    FOUND,
    MAX_NEW_STATES,
    TOO_MANY,
    UNFINISHED,
    continue_search,
    motions_to_goal,
)
from gridslam.kernels.planning.search_states import COUNT, Query, start_search
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.planning.guide_path import SPACING_M, poses_along_polyline
from gridslam.planning.options import PlanOptions
from gridslam.planning.refusals import no_path, path_too_long, search_limit_reached, unreachable_heading
from gridslam.planning.space import MIN_DISC_RADIUS_M, Space

Floats = NDArray[np.float64]
Costs = NDArray[np.float32]
Report = Callable[[int], None]

# Cells with more than this clearance beyond the required one have no extra cost: in passages up to twice as much wider than the
# robot and its margin, the path keeps to the middle.
INFLATION_RADIUS_M = 0.6
SEARCH_FACTOR = 1.3  # the cost-to-go extends to cells with up to this many times the cost of the start
# Largest number of states of one search
FIRST_SEARCH_STATES = 100_000
BACKWARD_SEARCH_STATES = 1_000_000
LAST_SEARCH_STATES = 3_000_000
# Largest number of states of all searches on one part or version of a map with too many cells; some 3 s
LARGE_MAP_STATES = 60_000
EXPANSIONS_PER_SLICE = 5_000  # well below a second
MAX_GUIDE_POSES = 50_000  # 20 km
COARSE_STEP_M, FINE_STEP_M = 0.15, 0.05  # length of an arc
YAW_BINS, FINE_YAW_BINS = 64, 240
COARSE_BIN, FINE_BIN = 0.5, 0.2  # width of a bin, in steps
# Turning radius in searches for robots that turn on the spot, whose smallest radius may be 0
MIN_SEARCH_RADIUS_M = 0.1
OPPOSITE_HEADING = np.array([0.0, 0.0, np.pi])


def no_report(states: int) -> None:
    """A `Report` that ignores the progress."""


class SearchResult(NamedTuple):
    """FOUND, EXHAUSTED or TOO_MANY, and the motions `(n, 2)` (length in m, curvature in 1/m), none unless FOUND."""

    status: int
    motions: Floats


class MotionSearch:
    """Searches for paths from `start` to `goal` `(3,)`, both in the frame of `space`; a goal yaw of NaN is free.

    A state of a search is a pose that it has reached. `report` is called several times a second with the number of states of the
    current search. All searches together have at most `max_states` states.
    """

    def __init__(
        self,
        occupancy: OccupancyGrid,
        space: Space,
        options: PlanOptions,
        start: Floats,
        goal: Floats,
        report: Report = no_report,
        max_states: float = np.inf,
    ) -> None:
        self._report = report
        self._max_states = max_states
        self.states = 0  # number of states in all searches so far
        self._occupancy, self._space, self._options = occupancy, space, options
        self._start, self._goal = start, goal
        smallest = options.min_radius_m
        self.radius_m = max(smallest, MIN_SEARCH_RADIUS_M) if options.turn_on_spot else smallest
        self._clearance_m = max(space.inner_radius_m, MIN_DISC_RADIUS_M) + space.margin_m

    def cost_to_go(self, obstacle_weight: float, whole_map: bool = False, from_start: bool = False) -> Costs:
        """Cost `(rows + 2, cols + 2)` (m) from the cells of the space to the goal, or `from_start` to the start.

        Only the cells around the shortest path have finite costs, or with `whole_map` all that are connected. `obstacle_weight`
        is the extra cost of a metre beside an obstacle. Raises MethodError if no path connects start and goal.
        """
        space = self._space
        cols = space.blocked.shape[1]
        ends = (self._start, self._goal) if from_start else (self._goal, self._start)
        (row, col), start = (space.nearest_open_cell(pose, self._clearance_m) for pose in ends)
        cost: Costs = cost_to_go(
            field=space.field,
            resolution=space.resolution_m,
            required=self._clearance_m,
            obstacle_weight=obstacle_weight,
            inflation_radius=INFLATION_RADIUS_M,
            goal=row * cols + col,
            start=start[0] * cols + start[1],
            search_factor=np.inf if whole_map else SEARCH_FACTOR,
        )
        if not np.isfinite(cost[start]):
            raise no_path(self._occupancy, space, self._options.occupied_from, self._start, self._goal)
        return cost

    def guide_path(self, cost: Costs) -> Floats:
        """Poses `(n, 3)` from start to goal along the polyline that descends the cost-to-go, pulled taut.

        Raises MethodError if it is longer than the planner's limit.
        """
        space = self._space
        row, col = space.nearest_open_cell(self._start, self._clearance_m)
        cells = descend(cost, row * cost.shape[1] + col)
        points = np.vstack([self._start[:2], (cells[:, ::-1] + 0.5) * space.resolution_m, self._goal[:2]])
        corners = np.asarray(pull_string(space.world_for_disc(self._clearance_m - space.margin_m), points))
        length_m = float(np.hypot(*np.diff(corners, axis=0).T).sum())
        if length_m > MAX_GUIDE_POSES * SPACING_M:
            raise path_too_long(length_m, MAX_GUIDE_POSES * SPACING_M)
        return poses_along_polyline(corners)

    def motions(
        self, start: Floats, goals: Floats, guide_path: Floats, cost: Costs, is_required: bool
    ) -> Floats | None:
        """Motions `(n, 2)` from `start` to one of the `goals` `(k, 3)`; None if the first search fails and no path is required.

        If a path is required, longer searches follow, and MethodError is raised if all fail. The longest one starts only after a
        search backwards from the goal: if the goal's heading points away from a wall just behind it, few poses can be reached
        backwards, and that search soon proves that there is no path.
        """
        result = self._search(start, goals, guide_path, cost, max_states=FIRST_SEARCH_STATES)
        if result.status == FOUND or not is_required:
            return result.motions if result.status == FOUND else None
        cost = self.cost_to_go(0.0, whole_map=True)
        if result.status == EXHAUSTED:  # within the cells that the first search was limited to
            result = self._search(start, goals, guide_path, cost, FIRST_SEARCH_STATES, is_fine=True)
            if result.status == EXHAUSTED:
                raise self._unreachable("start", self._start)
        if result.status != FOUND and len(goals) == 1 and not self._is_spent:
            result = self._search_from_goal(start, goals[0], guide_path)
            if result.status == EXHAUSTED:
                raise self._unreachable("goal", self._goal)
        if result.status != FOUND:
            result = self._search(start, goals, guide_path, cost, LAST_SEARCH_STATES)
        if result.status == EXHAUSTED:
            raise self._unreachable("start", self._start)
        if result.status != FOUND:
            raise search_limit_reached(self.radius_m, self.states)
        return result.motions

    @property
    def _is_spent(self) -> bool:
        """Whether another search might exceed `max_states`."""
        return self.states + MAX_NEW_STATES > self._max_states

    def _unreachable(self, name: str, pose: Floats) -> Exception:
        in_map = self._space.to_map(pose[None])[0]
        return unreachable_heading(name, in_map, self.radius_m, self._options.reverse)

    def _search_from_goal(self, start: Floats, goal: Floats, guide_path: Floats) -> SearchResult:
        """A search from the goal to the start with all headings reversed; its path is returned from start to goal."""
        ends = np.stack([goal, start]) + OPPOSITE_HEADING
        result = self._search(
            ends[0],
            ends[1][None],
            guide_path[::-1] + OPPOSITE_HEADING,
            self.cost_to_go(0.0, whole_map=True, from_start=True),
            BACKWARD_SEARCH_STATES,
            is_fine=True,
        )
        return result._replace(motions=result.motions[::-1] * [1.0, -1.0])

    def _search(
        self,
        start: Floats,
        goals: Floats,
        guide_path: Floats,
        cost: Costs,
        max_states: int,
        is_fine: bool = False,
    ) -> SearchResult:
        """One hybrid A* search with at most `max_states` states; `is_fine` uses short arcs and small bins."""
        if self._is_spent:
            return SearchResult(TOO_MANY, np.zeros((0, 2)))
        max_states = int(min(max_states, self._max_states - self.states))
        options = self._options
        step_m = FINE_STEP_M if is_fine else max(COARSE_STEP_M, 0.5 * self.radius_m)
        query = Query(
            goals=goals,
            guide_path=guide_path,
            cost_to_go=cost,
            limits=options.limits.for_kernels,
            radius=self.radius_m,
            step=step_m,
            bin_size=(FINE_BIN if is_fine else COARSE_BIN) * step_m,
            bin_yaws=FINE_YAW_BINS if is_fine else YAW_BINS,
            reverse_cost=options.reverse_cost_s if options.reverse else np.inf,
        )
        states = start_search(query, start, max_states)
        status = UNFINISHED
        while status == UNFINISHED:  # in slices, so that the search can be interrupted
            status = int(continue_search(self._space.world, query, states, EXPANSIONS_PER_SLICE))
            self._report(int(states.size[COUNT]))
        self.states += int(states.size[COUNT])
        motions = np.asarray(motions_to_goal(states)) if status == FOUND else np.zeros((0, 2))
        return SearchResult(status, motions)
