"""Reference implementations of the searches over poses: plain Python over dictionaries, lists and `heapq`.

Distances to obstacles and Dubins paths have references of their own; here they are those of the kernels.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning import search as kernel
from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.drive_limits import DriveLimits, speed_on
from gridslam.kernels.planning.dubins import connect
from gridslam.kernels.planning.search_states import MAX_EXPANSIONS_AFTER_GOAL, Query

Floats = NDArray[np.float64]
Motion = tuple[float, float]


@dataclass
class State:
    """A pose with its cost (s), the motions that lead to it from its parent, and the guide pose that it is, if any."""

    pose: Floats
    cost: float
    parent: int
    motions: list[Motion]
    guide: int | None
    is_goal: bool
    direction: int


class ReferencePoseSearch:
    """Hybrid A*: the cheapest state is expanded by arcs, by Dubins paths to the goals and to poses of the guide path."""

    def __init__(self, world: CollisionWorld, query: Query, start: Floats) -> None:
        self.world, self.query = world, query
        self.states = [State(start, 0.0, -1, [], None, False, 1)]
        self.queue = [(0.0, 0)]
        self.bins: dict[tuple[int, int, int, int], float] = {}
        self.guide_costs = [math.inf] * len(query.guide_path)

    def motions(self) -> list[Motion] | None:
        """The motions to a goal, equal neighbours merged; None if there is no path."""
        left = MAX_EXPANSIONS_AFTER_GOAL
        while self.queue:
            index = heapq.heappop(self.queue)[1]
            state, best = self.states[index], self.best_goal()
            left -= best is not None
            if state.is_goal or left == 0:
                return self.merged(best)
            if index > 0 and state.cost > self.lowest_cost(state):
                continue
            self.connect_to_guide_path(index)
            for direction in (1, -1) if math.isfinite(self.query.reverse_cost) else (1,):
                self.connect_to_goals(index, direction)
                self.steer(index, direction)
        return None

    def lowest_cost(self, state: State) -> float:
        if state.guide is not None:
            return self.guide_costs[state.guide]
        return self.bins[self.bin_of(state.pose, state.direction)]

    def best_goal(self) -> int | None:
        goals = [i for i, state in enumerate(self.states) if state.is_goal]
        return min(goals, key=lambda i: (self.states[i].cost, i), default=None)

    def add(self, state: State, priority: float) -> None:
        heapq.heappush(self.queue, (priority, len(self.states)))
        self.states.append(state)

    def steer(self, index: int, direction: int) -> None:
        state, query = self.states[index], self.query
        for relative in kernel.RELATIVE_CURVATURES:
            motion = direction * query.step, float(relative) / query.radius
            pose = np.array(advance(*state.pose, *motion))
            to_go = self.to_go(pose)
            if not math.isfinite(to_go):
                continue
            cost = state.cost + self.time([motion]) + self.change_cost(index, direction)
            if direction < 0:
                cost += query.step / query.limits.top_speed
            key = self.bin_of(pose, direction)
            if cost >= self.bins.get(key, math.inf) or not is_free(self.world, *state.pose, *motion):
                continue
            self.bins[key] = cost
            self.add(State(pose, cost, index, [motion], None, False, direction), cost + self.weighted(to_go))

    def connect_to_goals(self, index: int, direction: int) -> None:
        state, query = self.states[index], self.query
        if index % kernel.CONNECT_EVERY and self.to_go(state.pose) > kernel.GOAL_CONNECTION_M:
            return
        for goal in query.goals:
            longest = 3.0 * math.dist(goal[:2], state.pose[:2]) + 4.0 * math.pi * query.radius
            ends = (state.pose, goal) if direction > 0 else (goal, state.pose)
            motions, length = self.dubins(*ends, longest)
            if motions is None:
                continue
            cost = state.cost + self.time(motions) + self.change_cost(index, direction)
            if direction < 0:
                motions = [(-part, curvature) for part, curvature in reversed(motions)]
                cost += length / query.limits.top_speed
            self.add(State(goal, cost, index, motions, None, True, direction), cost)

    def connect_to_guide_path(self, index: int) -> None:
        state, query = self.states[index], self.query
        distances = ((query.guide_path[:, :2] - state.pose[:2]) ** 2).sum(axis=1)
        nearest = int(distances.argmin()) if state.guide is None else state.guide
        so_far = state.cost + self.change_cost(index, 1)
        for k in (nearest + offset for offset in kernel.GUIDE_OFFSETS.tolist()):
            if k >= len(query.guide_path):
                return
            pose = query.guide_path[k]
            distance = math.dist(pose[:2], state.pose[:2])
            if so_far + distance / query.limits.top_speed >= self.guide_costs[k]:
                continue
            motions, _ = self.dubins(state.pose, pose, 1.5 * distance + 2.0 * math.pi * query.radius)
            if motions is None or (cost := so_far + self.time(motions)) >= self.guide_costs[k]:
                continue
            self.guide_costs[k] = cost
            self.add(State(pose, cost, index, motions, k, False, 1), cost + self.weighted(self.to_go(pose)))

    def dubins(self, start: Floats, goal: Floats, longest: float) -> tuple[list[Motion] | None, float]:
        parts = np.zeros((3, 2))
        length = connect(self.world, start, goal, self.query.radius, longest, parts)
        return (list(map(tuple, parts.tolist())) if math.isfinite(length) else None), length

    def change_cost(self, index: int, direction: int) -> float:
        changes = index > 0 and self.states[index].direction != direction
        return self.query.reverse_cost if changes else 0.0

    def time(self, motions: list[Motion]) -> float:
        limits: DriveLimits = self.query.limits
        return sum(abs(length) / speed_on(curvature, limits) for length, curvature in motions if length)

    def to_go(self, pose: Floats) -> float:
        row, col = (int(v / self.world.resolution) for v in (pose[1], pose[0]))
        around = self.query.cost_to_go[max(row - 1, 0) : row + 2, max(col - 1, 0) : col + 2]
        return float(around.min()) if around.size else math.inf

    def weighted(self, to_go: float) -> float:
        return kernel.HEURISTIC_WEIGHT * to_go / self.query.limits.top_speed

    def bin_of(self, pose: Floats, direction: int) -> tuple[int, int, int, int]:
        size, yaws = self.query.bin_size, self.query.bin_yaws
        yaw = int((pose[2] % (2.0 * np.pi)) / (2.0 * np.pi) * yaws)
        return int(pose[1] / size), int(pose[0] / size), yaw, direction

    def merged(self, index: int | None) -> list[Motion]:
        chain: list[Motion] = []
        while index is not None and index >= 0:
            chain = [motion for motion in self.states[index].motions if motion[0]] + chain
            index = self.states[index].parent
        merged: list[Motion] = []
        for length, curvature in chain:
            if merged and merged[-1][1] == curvature and (merged[-1][0] > 0.0) == (length > 0.0):
                merged[-1] = merged[-1][0] + length, curvature
            else:
                merged.append((length, curvature))
        return merged
