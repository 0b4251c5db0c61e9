"""The states of a search over poses: a table of them, a heap of those to expand, and a hash table of their bins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.planning.drive_limits import YAW, DriveLimits, X, Y

ON_GRID, AT_GOAL = -1, -2  # marks of states that lie on no guide pose
COUNT, BEST_GOAL, QUEUED, EXPANSIONS_LEFT = 0, 1, 2, 3  # entries of States.size
MAX_EXPANSIONS_AFTER_GOAL = 4000  # states expanded after the first path to a goal, to find a cheaper one


class Query(NamedTuple):
    """Goals of a search, the robot's limits, and the grid of the states.

    goals: Poses `(g, 3)`, one of which is to be reached.
    guide_path: Poses `(m, 3)` along the guide path.
    cost_to_go: Cost (m) `(rows, cols)` from every cell to the goal, the heuristic.
    limits: The robot's speed limits.
    radius: Smallest turning radius (m).
    step: Length (m) of an arc.
    bin_size: Width (m) of a bin in x and y.
    bin_yaws: Number of bins of a full turn.
    reverse_cost: Cost (s) of a change of direction; infinite to forbid driving backwards.
    """

    goals: NDArray[np.float64]
    guide_path: NDArray[np.float64]
    cost_to_go: NDArray[np.float32]
    limits: DriveLimits
    radius: float
    step: float
    bin_size: float
    bin_yaws: int
    reverse_cost: float


class States(NamedTuple):
    """The states found so far, and the lowest costs of the bins (a hash table) and of the guide path's poses.

    size: Numbers of states (COUNT), of queued states (QUEUED) and of expansions left after a goal was reached
        (EXPANSIONS_LEFT); index of the cheapest state at a goal (BEST_GOAL), -1 if there is none.
    parts: Motions `(n, 3, 2)` from the parent: length (m, negative: backwards), curvature (1/m).
    mark: ON_GRID, AT_GOAL or the index of a pose of the guide path.
    direction: +1, or -1 if the robot arrived backwards.
    queue_priority, queue_node: A binary heap of the states to expand, lowest priority first, then lowest index.
    """

    size: NDArray[np.int64]
    pose: NDArray[np.float64]
    cost: NDArray[np.float64]
    parent: NDArray[np.int64]
    parts: NDArray[np.float64]
    mark: NDArray[np.int64]
    direction: NDArray[np.int64]
    keys: NDArray[np.int64]
    best: NDArray[np.float64]
    guide_best: NDArray[np.float64]
    queue_priority: NDArray[np.float64]
    queue_node: NDArray[np.int64]


@compiled
def start_search(query: Query, start: NDArray[np.float64], max_states: int) -> States:
    """The states of a search that has not expanded its start pose `(3,)` yet."""
    slots = 1
    while slots < 2 * max_states:
        slots *= 2
    states = States(
        size=np.array([1, -1, 0, MAX_EXPANSIONS_AFTER_GOAL]),  # COUNT, BEST_GOAL, QUEUED, EXPANSIONS_LEFT
        pose=np.empty((max_states, 3)),
        cost=np.empty(max_states),
        parent=np.empty(max_states, np.int64),
        parts=np.empty((max_states, 3, 2)),
        mark=np.empty(max_states, np.int64),
        direction=np.empty(max_states, np.int64),
        keys=np.full(slots, -1, np.int64),
        best=np.full(slots, np.inf),
        guide_best=np.full(query.guide_path.shape[0], np.inf),
        queue_priority=np.empty(max_states),
        queue_node=np.empty(max_states, np.int64),
    )
    states.pose[0] = start
    states.cost[0], states.parent[0], states.mark[0], states.direction[0] = 0.0, -1, ON_GRID, 1
    states.parts[0] = 0.0
    queue_state(states, 0.0, 0)
    return states


@compiled
def push_state(
    states: States,
    parent: int,
    pose: NDArray[np.float64],
    cost: float,
    priority: float,
    mark: int,
    direction: int,
    motion: NDArray[np.float64],
) -> None:
    """Append a state reached from `parent` by a `motion` `(3, 2)` at a `cost` (s), and queue it by its `priority`.

    `pose` (3,), `mark` and `direction` are those of `States`.
    """
    n = states.size[COUNT]
    copy_row(states.pose, n, pose)
    copy_row(states.parts, n, motion)
    states.cost[n], states.parent[n], states.mark[n], states.direction[n] = cost, parent, mark, direction
    states.size[COUNT] = n + 1
    if mark == AT_GOAL and (states.size[BEST_GOAL] < 0 or cost < states.cost[states.size[BEST_GOAL]]):
        states.size[BEST_GOAL] = n
    queue_state(states, priority, n)


@compiled
def queue_state(states: States, priority: float, node: int) -> None:
    """Add a state to the heap."""
    at = states.size[QUEUED]
    states.size[QUEUED] = at + 1
    while at > 0:
        above = (at - 1) // 2
        if states.queue_priority[above] < priority or (
            states.queue_priority[above] == priority and states.queue_node[above] < node
        ):
            break
        states.queue_priority[at], states.queue_node[at] = (
            states.queue_priority[above],
            states.queue_node[above],
        )
        at = above
    states.queue_priority[at], states.queue_node[at] = priority, node


@compiled
def next_state(states: States) -> int:
    """Remove the state with the lowest priority from the heap; there must be one."""
    first = states.queue_node[0]
    last = states.size[QUEUED] - 1
    states.size[QUEUED] = last
    priority, node = states.queue_priority[last], states.queue_node[last]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= last:
            break
        if below + 1 < last and (
            states.queue_priority[below + 1] < states.queue_priority[below]
            or (
                states.queue_priority[below + 1] == states.queue_priority[below]
                and states.queue_node[below + 1] < states.queue_node[below]
            )
        ):
            below += 1
        if priority < states.queue_priority[below] or (
            priority == states.queue_priority[below] and node < states.queue_node[below]
        ):
            break
        states.queue_priority[at], states.queue_node[at] = (
            states.queue_priority[below],
            states.queue_node[below],
        )
        at = below
    states.queue_priority[at], states.queue_node[at] = priority, node
    return int(first)


@compiled
def hash_slot(query: Query, states: States, pose: NDArray[np.float64], direction: int) -> tuple[int, int]:
    """The slot of the hash table that holds, or would hold, the bin of a pose (3,) and direction (+1, -1), and its key."""
    row, col = int(pose[Y] / query.bin_size), int(pose[X] / query.bin_size)
    yaw = int((pose[YAW] % (2.0 * np.pi)) / (2.0 * np.pi) * query.bin_yaws)
    key = (((row << 22) + col) << 12) + (yaw << 1) + (1 if direction > 0 else 0)
    last = states.keys.shape[0] - 1
    slot = ((key ^ (key >> 17)) * 0x9E3779B1 >> 7) & last
    while states.keys[slot] != key and states.keys[slot] != -1:
        slot = (slot + 1) & last
    return slot, key


@compiled
def extract_motions(states: States, node: int) -> NDArray[np.float64]:
    """Motions `(m, 2)` from the start to a state: length (m, negative: backwards), curvature (1/m); equal neighbours merged."""
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
