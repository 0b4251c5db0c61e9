"""Search over poses: short arcs and lines, Dubins paths to the goal, and Dubins paths along a rough way (hybrid A*).

After Dolgov et al. 2010: a state's pose is continuous, of all states in one bin of x, y, yaw the cheapest is kept. The poses
of a rough way, the taut string through the map, are states too: they lead exactly through passages that no grid of
arcs would hit. Costs are driving times at the speed that each curvature allows.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import World, advance, is_free
from gridslam.kernels.planning.dubins import connect

FOUND, EXHAUSTED, TOO_MANY = 0, 1, 2
GREED = 1.3
GOAL_SHOT_M = 3.0
SHOOT_EVERY = 16  # states far from the goal
AFTER_FIRST = 4000  # states that are still looked at once a goal is reached
ALONG = np.array([1, 2, 4, 7, 11], np.int64)
BENDS = np.array([0.0, 1.0, -1.0, 0.4, -0.4, 0.15, -0.15])  # in units of the sharpest
BETWEEN, AT_GOAL = -1, -2


class Query(NamedTuple):
    """What is asked for.

    `goals` `(g, 3)` are the poses of which one is to be reached, `spine` `(m, 3)` those along a rough way, `togo` the cost
    (m) from every cell to the goal. `limits` are top speed, lateral acceleration and turn rate, `radius` (m) the smallest.
    Arcs are `step` (m) long, bins `bin_size` (m) wide and a full turn / `bin_yaws` large. `reverse_cost` is the price (s) of
    a change of direction, infinite to forbid driving backwards.
    """

    goals: NDArray[np.float64]
    spine: NDArray[np.float64]
    togo: NDArray[np.float32]
    limits: NDArray[np.float64]
    radius: float
    step: float
    bin_size: float
    bin_yaws: int
    reverse_cost: float


class States(NamedTuple):
    """The states found so far, and the least costs of bins (a hash table) and of the spine's poses.

    `size` holds their number and the index of the cheapest at a goal, -1 before there is one.

    `parts` `(n, 3, 2)` are the motions (length, < 0: backwards; curvature) from the parent; `mark` is BETWEEN, AT_GOAL or
    the index of a pose of the spine; `sense` is +1, or -1 where the robot came backwards.
    """

    size: NDArray[np.int64]
    pose: NDArray[np.float64]
    cost: NDArray[np.float64]
    parent: NDArray[np.int64]
    parts: NDArray[np.float64]
    mark: NDArray[np.int64]
    sense: NDArray[np.int64]
    keys: NDArray[np.int64]
    best: NDArray[np.float64]
    spine_best: NDArray[np.float64]


@compiled
def speed_on(curvature: float, top_speed: float, lateral: float, turn_rate: float) -> float:
    """The speed (m/s) that a curvature (1/m) allows: lateral acceleration v^2 k, turn rate v k."""
    k = abs(curvature)
    if k < 1e-9:
        return top_speed
    return float(min(top_speed, np.sqrt(lateral / k), turn_rate / k))


@compiled
def search_poses(
    world: World, query: Query, start: NDArray[np.float64], most: int
) -> tuple[int, NDArray[np.float64], int]:
    """A drivable path from the start to one of the goals, as motions `(n, 2)` of length (m, < 0: backwards) and curvature.

    The path is not the cheapest: once a goal is reached, the search goes on for a bounded time only. Returns FOUND, EXHAUSTED
    (there is no path) or TOO_MANY (more than `most` states), the motions, and the number of states.
    """
    ways = 2 if np.isfinite(query.reverse_cost) else 1
    slots = 1
    while slots < 2 * most:
        slots *= 2
    states = States(
        np.array([1, -1]),
        np.empty((most, 3)),
        np.empty(most),
        np.empty(most, np.int64),
        np.empty((most, 3, 2)),
        np.empty(most, np.int64),
        np.empty(most, np.int64),
        np.full(slots, -1, np.int64),
        np.full(slots, np.inf),
        np.full(query.spine.shape[0], np.inf),
    )
    states.pose[0] = start
    states.cost[0], states.parent[0], states.mark[0], states.sense[0] = 0.0, -1, BETWEEN, 1
    states.parts[0] = 0.0
    queue = [(0.0, 0)]
    patience = AFTER_FIRST
    while len(queue) > 0:
        _, node = heapq.heappop(queue)
        mark, cost = states.mark[node], states.cost[node]
        if states.size[1] >= 0:
            patience -= 1
        if mark == AT_GOAL or patience == 0:
            return FOUND, _trace(states, states.size[1]), states.size[0]
        if mark >= 0:
            if cost > states.spine_best[mark]:
                continue
        elif node > 0 and cost > states.best[_slot(query, states, states.pose[node], states.sense[node])[0]]:
            continue
        if states.size[0] + 64 > most:
            if states.size[1] < 0:
                return TOO_MANY, states.parts[0, :0].copy(), states.size[0]
            return FOUND, _trace(states, states.size[1]), states.size[0]
        _shoot_along_spine(world, query, states, queue, node)
        for way in range(ways):
            _shoot_at_goals(world, query, states, queue, node, 1 - 2 * way)
            _steer(world, query, states, queue, node, 1 - 2 * way)
    return EXHAUSTED, states.parts[0, :0].copy(), states.size[0]


@compiled
def _shoot_at_goals(
    world: World, query: Query, states: States, queue: list[tuple[float, int]], node: int, sense: int
) -> None:
    """Dubins paths to the goals, from states near them and now and then from others.

    A path driven backwards is the path forwards from the goal, with its parts the other way round.
    """
    here = states.pose[node]
    if node % SHOOT_EVERY != 0 and _to_go(world, query, here) > GOAL_SHOT_M:
        return
    shot = np.zeros((3, 2))
    for goal in query.goals:
        longest = 3.0 * np.hypot(goal[0] - here[0], goal[1] - here[1]) + 4.0 * np.pi * query.radius
        if sense > 0:
            found = connect(world, here, goal, query.radius, longest, shot)
        else:
            found = connect(world, goal, here, query.radius, longest, shot)
            shot[:, 0] = -shot[:, 0]
            shot = shot[::-1].copy()
        if np.isfinite(found):
            cost = states.cost[node] + _time(shot, query.limits) + _switch(query, states, node, sense)
            if sense < 0:
                cost += found / query.limits[0]
            _add(states, queue, node, goal, cost, cost, AT_GOAL, sense, shot)


@compiled
def _shoot_along_spine(
    world: World, query: Query, states: States, queue: list[tuple[float, int]], node: int
) -> None:
    """Dubins paths to poses of the rough way that lie ahead of the nearest."""
    here = states.pose[node]
    near = states.mark[node] if states.mark[node] >= 0 else _nearest(query.spine, here)
    shot = np.zeros((3, 2))
    so_far = states.cost[node] + _switch(query, states, node, 1)
    for ahead in ALONG:
        k = near + ahead
        if k >= query.spine.shape[0]:
            return
        pose = query.spine[k]
        away = np.hypot(pose[0] - here[0], pose[1] - here[1])
        if so_far + away / query.limits[0] >= states.spine_best[k]:
            continue
        longest = 1.5 * away + 2.0 * np.pi * query.radius
        if not np.isfinite(connect(world, here, pose, query.radius, longest, shot)):
            continue
        cost = so_far + _time(shot, query.limits)
        if cost < states.spine_best[k]:
            states.spine_best[k] = cost
            guess = cost + GREED * _to_go(world, query, pose) / query.limits[0]
            _add(states, queue, node, pose, cost, guess, k, 1, shot)


@compiled
def _switch(query: Query, states: States, node: int, sense: int) -> float:
    """The price of a change of direction, if it is one; none at the very start."""
    return 0.0 if node == 0 or states.sense[node] == sense else query.reverse_cost


@compiled
def _steer(
    world: World, query: Query, states: States, queue: list[tuple[float, int]], node: int, sense: int
) -> None:
    """One step straight and along arcs; `sense` -1: backwards, at twice the cost."""
    x, y, yaw = states.pose[node]
    motion = np.zeros((3, 2))
    pose = np.empty(3)
    for bend in BENDS:
        curvature, length = bend / query.radius, sense * query.step
        pose[0], pose[1], pose[2] = advance(x, y, yaw, length, curvature)
        cost = states.cost[node] + query.step / speed_on(
            curvature, query.limits[0], query.limits[1], query.limits[2]
        )
        if sense < 0:
            cost += query.step / query.limits[0]
        cost += _switch(query, states, node, sense)
        rest = _to_go(world, query, pose)
        if not np.isfinite(rest):
            continue
        slot, key = _slot(query, states, pose, sense)
        if cost >= states.best[slot] or not is_free(world, x, y, yaw, length, curvature):
            continue
        states.keys[slot], states.best[slot] = key, cost
        motion[0, 0], motion[0, 1] = length, curvature
        _add(states, queue, node, pose, cost, cost + GREED * rest / query.limits[0], BETWEEN, sense, motion)


@compiled
def _add(
    states: States,
    queue: list[tuple[float, int]],
    parent: int,
    pose: NDArray[np.float64],
    cost: float,
    guess: float,
    mark: int,
    sense: int,
    motion: NDArray[np.float64],
) -> None:
    n = states.size[0]
    states.pose[n], states.parts[n] = pose, motion
    states.cost[n], states.parent[n], states.mark[n], states.sense[n] = cost, parent, mark, sense
    states.size[0] = n + 1
    if mark == AT_GOAL and (states.size[1] < 0 or cost < states.cost[states.size[1]]):
        states.size[1] = n
    heapq.heappush(queue, (guess, n))


@compiled
def _slot(query: Query, states: States, pose: NDArray[np.float64], sense: int) -> tuple[int, int]:
    """Where the hash table holds, or would hold, the bin of a pose, and the bin's key."""
    row, col = int(pose[1] / query.bin_size), int(pose[0] / query.bin_size)
    yaw = int((pose[2] % (2.0 * np.pi)) / (2.0 * np.pi) * query.bin_yaws)
    key = (((row << 22) + col) << 12) + (yaw << 1) + (1 if sense > 0 else 0)
    last = states.keys.shape[0] - 1
    slot = ((key ^ (key >> 17)) * 0x9E3779B1 >> 7) & last
    while states.keys[slot] != key and states.keys[slot] != -1:
        slot = (slot + 1) & last
    return slot, key


@compiled
def _to_go(world: World, query: Query, pose: NDArray[np.float64]) -> float:
    """The least cost to go of the cell and its neighbours; infinite where there is none."""
    rows, cols = query.togo.shape
    row, col = int(pose[1] / world.resolution), int(pose[0] / world.resolution)
    least = np.inf
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(col - 1, 0), min(col + 2, cols)):
            least = min(least, query.togo[r, c])
    return least


@compiled
def _nearest(spine: NDArray[np.float64], pose: NDArray[np.float64]) -> int:
    best, index = np.inf, 0
    for k in range(spine.shape[0]):
        apart = (spine[k, 0] - pose[0]) ** 2 + (spine[k, 1] - pose[1]) ** 2
        if apart < best:
            best, index = apart, k
    return index


@compiled
def _time(parts: NDArray[np.float64], limits: NDArray[np.float64]) -> float:
    total = 0.0
    for k in range(parts.shape[0]):
        if parts[k, 0] != 0.0:
            total += abs(parts[k, 0]) / speed_on(parts[k, 1], limits[0], limits[1], limits[2])
    return total


@compiled
def _trace(states: States, node: int) -> NDArray[np.float64]:
    """The motions from the start to a state, equal neighbours joined."""
    chain = [node]
    while states.parent[chain[-1]] >= 0:
        chain.append(states.parent[chain[-1]])
    out = np.empty((3 * len(chain), 2))
    n = 0
    for i in range(len(chain) - 1, -1, -1):
        for k in range(3):
            length, curvature = states.parts[chain[i], k]
            if length == 0.0:
                continue
            if n > 0 and out[n - 1, 1] == curvature and (out[n - 1, 0] > 0.0) == (length > 0.0):
                out[n - 1, 0] += length
            else:
                out[n, 0], out[n, 1] = length, curvature
                n += 1
    return out[:n].copy()
