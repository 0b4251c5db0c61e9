"""Reference implementation of the planner's search over poses (hybrid A*, Dolgov et al. 2010)."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.drive_limits import speed_on
from gridslam.kernels.planning.dubins import connect
from gridslam.kernels.planning.search import (
    CONNECT_EVERY,
    GOAL_CONNECTION_M,
    GUIDE_OFFSETS,
    HEURISTIC_WEIGHT,
    RELATIVE_CURVATURES,
)
from gridslam.kernels.planning.search_states import MAX_EXPANSIONS_AFTER_GOAL, Query

Floats = NDArray[np.float64]
Pose = tuple[float, float, float]
Motions = list[tuple[float, float]]  # length (m, negative: backwards) and curvature (1/m)
Place = tuple[object, ...]  # ("bin", row, col, yaw, direction), ("guide", index), START or GOAL
START, GOAL = ("start",), ("goal",)


@dataclass
class State:
    """A pose, how it was reached and for how many seconds; of all states at one place the cheapest is expanded."""

    pose: Pose
    cost: float
    place: Place
    direction: int
    motions: Motions


class HybridAStar:
    """The search; `run` returns the motions from the start to a goal, or None."""

    def __init__(self, world: CollisionWorld, query: Query, start: Pose) -> None:
        self.world, self.query = world, query
        self.states: list[State] = []
        self.queue: list[tuple[float, int]] = []
        self.best: dict[Place, float] = {}
        self.cheapest_at_goal: State | None = None
        self.add(State(start, 0.0, START, 1, []), priority=0.0)

    def run(self) -> Motions | None:
        """Expand states, the one with the lowest priority first, until a goal is one or the time after the first goal is over."""
        left = MAX_EXPANSIONS_AFTER_GOAL
        while self.queue:
            number = heapq.heappop(self.queue)[1]
            state = self.states[number]
            if self.cheapest_at_goal is not None:
                left -= 1
                if state.place == GOAL or left == 0:
                    return self.cheapest_at_goal.motions
            if state.cost > self.best[state.place]:
                continue
            self.connect_to_guide_path(state)
            for direction in (1, -1) if math.isfinite(self.query.reverse_cost) else (1,):
                if number % CONNECT_EVERY == 0 or self.cost_to_go(state.pose) <= GOAL_CONNECTION_M:
                    self.connect_to_goals(state, direction)
                self.steer(state, direction)
        return None

    def add(self, state: State, priority: float) -> None:
        """Queue a state, the cheapest at its place so far; at the goals all are."""
        heapq.heappush(self.queue, (priority, len(self.states)))
        self.states.append(state)
        if state.place != GOAL:
            self.best[state.place] = state.cost
        elif self.cheapest_at_goal is None or state.cost < self.cheapest_at_goal.cost:
            self.cheapest_at_goal = state

    def steer(self, state: State, direction: int) -> None:
        """Drive one step straight and one along each arc, to bins that nothing has reached at a lower cost."""
        for curvature in RELATIVE_CURVATURES / self.query.radius:
            length = direction * self.query.step
            pose = advance(*state.pose, length, curvature)
            rest = self.cost_to_go(pose)
            place = self.bin_of(pose, direction)
            cost = state.cost + self.time([(length, curvature)]) + self.cost_of_turning_back(state, direction)
            is_better = math.isfinite(rest) and cost < self.best.get(place, math.inf)
            if is_better and is_free(self.world, *state.pose, length, curvature):
                reached = State(pose, cost, place, direction, [*state.motions, (length, curvature)])
                self.add(reached, cost + self.estimate(rest))

    def connect_to_guide_path(self, state: State) -> None:
        """Take Dubins paths to poses of the guide path ahead of the state, where they arrive earlier than anything before."""
        path = self.query.guide_path
        if state.place[0] == "guide":
            near = int(str(state.place[1]))
        else:
            near = int(np.argmin(((path[:, :2] - state.pose[:2]) ** 2).sum(axis=1)))
        for k in near + GUIDE_OFFSETS[near + GUIDE_OFFSETS < len(path)]:
            place = ("guide", int(k))
            before = self.best.get(place, math.inf)
            at_once = state.cost + self.cost_of_turning_back(state, 1)
            apart = math.dist(path[k, :2], state.pose[:2])
            if at_once + apart / self.query.limits.top_speed >= before:
                continue
            motions = self.dubins(state.pose, path[k], 1.5 * apart + 2.0 * math.pi * self.query.radius)
            if motions and at_once + self.time(motions) < before:
                pose = (float(path[k, 0]), float(path[k, 1]), float(path[k, 2]))
                reached = State(pose, at_once + self.time(motions), place, 1, [*state.motions, *motions])
                self.add(reached, reached.cost + self.estimate(self.cost_to_go(pose)))

    def connect_to_goals(self, state: State, direction: int) -> None:
        """Take the Dubins path to each goal; backwards it is that from the goal, from its end to its start."""
        for goal in self.query.goals:
            longest = 3.0 * math.dist(goal[:2], state.pose[:2]) + 4.0 * math.pi * self.query.radius
            if direction > 0:
                motions = self.dubins(state.pose, goal, longest)
            else:
                motions = [
                    (-length, curvature) for length, curvature in self.dubins(goal, state.pose, longest)[::-1]
                ]
            if motions:
                cost = state.cost + self.time(motions) + self.cost_of_turning_back(state, direction)
                pose = (float(goal[0]), float(goal[1]), float(goal[2]))
                self.add(State(pose, cost, GOAL, direction, [*state.motions, *motions]), cost)

    def dubins(self, start: Pose | Floats, end: Pose | Floats, longest: float) -> Motions:
        """The shortest free Dubins path; empty if there is none that is short enough."""
        parts = np.zeros((3, 2))
        length = connect(self.world, np.array(start), np.array(end), self.query.radius, longest, parts)
        return [(float(a), float(b)) for a, b in parts if a != 0.0] if math.isfinite(length) else []

    def time(self, motions: Motions) -> float:
        """Seconds to drive motions at the highest speed on each; backwards they count what the top speed takes once more."""
        limits = self.query.limits
        return sum(
            abs(length) / speed_on(curvature, limits)
            + (abs(length) / limits.top_speed if length < 0.0 else 0.0)
            for length, curvature in motions
        )

    def cost_of_turning_back(self, state: State, direction: int) -> float:
        """Cost (s) of the change from the direction in which a state was reached."""
        return 0.0 if state.place == START or state.direction == direction else self.query.reverse_cost

    def cost_to_go(self, pose: Pose) -> float:
        """Lowest cost-to-go (m) of the 3 x 3 cells around a pose."""
        row, col = int(pose[1] / self.world.resolution), int(pose[0] / self.world.resolution)
        around = self.query.cost_to_go[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
        return float(around.min()) if around.size else math.inf

    def estimate(self, rest: float) -> float:
        """Seconds that the rest of the way counts in a priority."""
        return HEURISTIC_WEIGHT * rest / self.query.limits.top_speed

    def bin_of(self, pose: Pose, direction: int) -> Place:
        """The bin of x, y and yaw."""
        size, yaws = self.query.bin_size, self.query.bin_yaws
        turned = int(pose[2] % (2.0 * math.pi) / (2.0 * math.pi) * yaws)
        return ("bin", int(pose[1] / size), int(pose[0] / size), turned, direction)
