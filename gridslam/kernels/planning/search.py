"""Search over poses with short arcs and lines and with Dubins paths, guided by a path over the cells (hybrid A*).

After Dolgov et al. 2010: a state's pose is continuous, and of all states in one bin of x, y, yaw the cheapest is kept. The poses
of the guide path, a polyline pulled taut through the map, are states too: they lead exactly through passages that no
grid of arcs would hit. Costs are driving times at the speed that each curvature allows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.drive_limits import YAW, DriveLimits, X, Y, speed_on
from gridslam.kernels.planning.dubins import connect
from gridslam.kernels.planning.search_states import (
    AT_GOAL,
    BEST_GOAL,
    COUNT,
    EXPANSIONS_LEFT,
    ON_GRID,
    QUEUED,
    Query,
    States,
    extract_motions,
    hash_slot,
    next_state,
    push_state,
)

FOUND, EXHAUSTED, TOO_MANY, UNFINISHED = 0, 1, 2, 3  # results of a search
# Weight above 1: a weighted A*, which expands fewer states and may miss the cheapest path
HEURISTIC_WEIGHT = 1.3
GOAL_CONNECTION_M = 3.0  # every state with less than this left to go is connected to the goals
CONNECT_EVERY = 16  # every 16th of the states farther away is connected too
# Poses ahead on the guide path that a state is connected to
GUIDE_OFFSETS = np.array([1, 2, 4, 7, 11], np.int64)
# Curvatures of the arcs, in units of 1 / radius
RELATIVE_CURVATURES = np.array([0.0, 1.0, -1.0, 0.4, -0.4, 0.15, -0.15])
MAX_NEW_STATES = 64  # largest number of states that one expansion can add, rounded up


@compiled
def continue_search(world: CollisionWorld, query: Query, states: States, max_expansions: int) -> int:
    """Expand at most `max_expansions` states, the cheapest first.

    Returns FOUND, EXHAUSTED (there is no path), TOO_MANY (there is no room for more states) or UNFINISHED. The path found is
    not the cheapest: after a goal is reached, the search continues for a bounded number of states only.
    """
    directions = 2 if np.isfinite(query.reverse_cost) else 1
    expansions = 0
    while states.size[QUEUED] > 0:
        if expansions == max_expansions:
            return UNFINISHED
        expansions += 1
        node = next_state(states)
        mark, cost = states.mark[node], states.cost[node]
        if states.size[BEST_GOAL] >= 0:
            states.size[EXPANSIONS_LEFT] -= 1
        if mark == AT_GOAL or states.size[EXPANSIONS_LEFT] == 0:
            return FOUND
        if mark >= 0:
            if cost > states.guide_best[mark]:
                continue
        elif node > 0:
            slot = hash_slot(query, states, states.pose[node], states.direction[node])[0]
            if cost > states.best[slot]:
                continue
        if states.size[COUNT] + MAX_NEW_STATES > states.cost.shape[0]:
            return FOUND if states.size[BEST_GOAL] >= 0 else TOO_MANY
        _connect_to_guide_path(world, query, states, node)
        for index in range(directions):
            _connect_to_goals(world, query, states, node, 1 - 2 * index)
            _steer(world, query, states, node, 1 - 2 * index)
    return EXHAUSTED


@compiled
def motions_to_goal(states: States) -> NDArray[np.float64]:
    """The motions `(n, 2)` to the cheapest state at a goal: length (m, negative: backwards) and curvature (1/m)."""
    motions: NDArray[np.float64] = extract_motions(states, states.size[BEST_GOAL])
    return motions


@compiled
def _connect_to_goals(
    world: CollisionWorld,
    query: Query,
    states: States,
    node: int,
    direction: int,
) -> None:
    """Add Dubins paths to the goals, from states near them and occasionally from others.

    A path driven backwards is the forward path from the goal with its parts in reverse order.
    """
    here = states.pose[node]
    if node % CONNECT_EVERY != 0 and _cost_to_go_at(world, query, here) > GOAL_CONNECTION_M:
        return
    connection = np.zeros((3, 2))
    for goal in query.goals:
        max_length = 3.0 * np.hypot(goal[X] - here[X], goal[Y] - here[Y]) + 4.0 * np.pi * query.radius
        if direction > 0:
            found = connect(world, here, goal, radius=query.radius, max_length=max_length, out=connection)
        else:
            found = connect(world, goal, here, radius=query.radius, max_length=max_length, out=connection)
            connection[:, 0] = -connection[:, 0]
            connection = connection[::-1].copy()
        if np.isfinite(found):
            cost = (
                states.cost[node]
                + _driving_time(connection, query.limits)
                + _direction_change_cost(query, states, node, direction)
            )
            if direction < 0:
                cost += found / query.limits.top_speed
            push_state(
                states,
                node,
                pose=goal,
                cost=cost,
                priority=cost,
                mark=AT_GOAL,
                direction=direction,
                motion=connection,
            )


@compiled
def _connect_to_guide_path(world: CollisionWorld, query: Query, states: States, node: int) -> None:
    """Add Dubins paths to poses of the guide path ahead of the nearest one."""
    here = states.pose[node]
    near = states.mark[node] if states.mark[node] >= 0 else _nearest_on_guide_path(query.guide_path, here)
    connection = np.zeros((3, 2))
    so_far = states.cost[node] + _direction_change_cost(query, states, node, 1)
    for ahead in GUIDE_OFFSETS:
        k = near + ahead
        if k >= query.guide_path.shape[0]:
            return
        pose = query.guide_path[k]
        away = np.hypot(pose[X] - here[X], pose[Y] - here[Y])
        if so_far + away / query.limits.top_speed >= states.guide_best[k]:
            continue
        max_length = 1.5 * away + 2.0 * np.pi * query.radius
        if not np.isfinite(
            connect(world, here, pose, radius=query.radius, max_length=max_length, out=connection)
        ):
            continue
        cost = so_far + _driving_time(connection, query.limits)
        if cost < states.guide_best[k]:
            states.guide_best[k] = cost
            priority = cost + HEURISTIC_WEIGHT * _cost_to_go_at(world, query, pose) / query.limits.top_speed
            push_state(
                states, node, pose=pose, cost=cost, priority=priority, mark=k, direction=1, motion=connection
            )


@compiled
def _direction_change_cost(query: Query, states: States, node: int, direction: int) -> float:
    """Cost (s) if `direction` differs from that of the state; 0 at the start."""
    return 0.0 if node == 0 or states.direction[node] == direction else query.reverse_cost


@compiled
def _steer(
    world: CollisionWorld,
    query: Query,
    states: States,
    node: int,
    direction: int,
) -> None:
    """Add one step straight and one along each arc; `direction` -1 is backwards, at twice the cost."""
    x, y, yaw = states.pose[node]
    motion = np.zeros((3, 2))
    pose = np.empty(3)
    for relative_curvature in RELATIVE_CURVATURES:
        curvature, length = relative_curvature / query.radius, direction * query.step
        pose[X], pose[Y], pose[YAW] = advance(x, y, yaw, length, curvature)
        cost = states.cost[node] + query.step / speed_on(curvature, query.limits)
        if direction < 0:
            cost += query.step / query.limits.top_speed
        cost += _direction_change_cost(query, states, node, direction)
        rest = _cost_to_go_at(world, query, pose)
        if not np.isfinite(rest):
            continue
        slot, key = hash_slot(query, states, pose, direction)
        if cost >= states.best[slot] or not is_free(world, x, y, yaw=yaw, length=length, curvature=curvature):
            continue
        states.keys[slot], states.best[slot] = key, cost
        motion[0, 0], motion[0, 1] = length, curvature
        push_state(
            states,
            node,
            pose=pose,
            cost=cost,
            priority=cost + HEURISTIC_WEIGHT * rest / query.limits.top_speed,
            mark=ON_GRID,
            direction=direction,
            motion=motion,
        )


@compiled
def _cost_to_go_at(world: CollisionWorld, query: Query, pose: NDArray[np.float64]) -> float:
    """Lowest cost-to-go of the pose's cell and its neighbours; infinite if none has any."""
    rows, cols = query.cost_to_go.shape
    row, col = int(pose[Y] / world.resolution), int(pose[X] / world.resolution)
    lowest = np.inf
    for r in range(max(row - 1, 0), min(row + 2, rows)):
        for c in range(max(col - 1, 0), min(col + 2, cols)):
            lowest = min(lowest, query.cost_to_go[r, c])
    return lowest


@compiled
def _nearest_on_guide_path(guide_path: NDArray[np.float64], pose: NDArray[np.float64]) -> int:
    """Index of the guide path's pose nearest to a pose."""
    best, index = np.inf, 0
    for k in range(guide_path.shape[0]):
        apart = (guide_path[k, X] - pose[X]) ** 2 + (guide_path[k, Y] - pose[Y]) ** 2
        if apart < best:
            best, index = apart, k
    return index


@compiled
def _driving_time(parts: NDArray[np.float64], limits: DriveLimits) -> float:
    """Time (s) to drive parts `(n, 2)` at the highest speed that each curvature allows."""
    total = 0.0
    for k in range(parts.shape[0]):
        if parts[k, 0] != 0.0:
            total += abs(parts[k, 0]) / speed_on(parts[k, 1], limits)
    return total
