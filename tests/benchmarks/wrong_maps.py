"""Right and wrong maps of large places made by seed: what loop closure would have made of its loops if they were right, or wrong.

A map is a set of poses of the key scans: a pose graph of the front end's steps and of loops taken from the truth. In wrong
maps the loops are cut off, or those of one passage are shifted by a bay or sideways, or one loop is forced elsewhere; or a right
map has a kink, or is too large.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.lidar_slam.key_scans import distribute_corrections
from gridslam.lidar_slam.loop_closure.trajectory import close_trajectory
from tests.benchmarks.tracked_places import TrackedPlace

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

NODE_M = 2.0  # of path between the nodes of the pose graph
SAME_PLACE_M, APART_M = 1.5, 25.0  # nodes this near, with so much travel between them, are a loop
LOOP_STD = (0.04, 0.04, 0.004)  # of a right loop (m, m, rad)
STEP_STD_PER_SQRT_M = (0.03, 0.03, 0.004)
ROBUST_SCALE = 5.0
SHIFT_M = (2.4, 4.5)  # of the loops that are a bay off
FORCED_M = 6.0
KINK_RAD = (0.06, 0.3)
SCALE_ERROR = (0.04, 0.1)


@dataclass(frozen=True, slots=True)
class LoopGraph:
    """The nodes of a place (rows of its key scans), the edges between neighbours, and its true loops `(l, 2)`."""

    place: TrackedPlace
    nodes: Ints
    steps: Edges
    loops: Ints


@dataclass(frozen=True, slots=True)
class MadeMap:
    """A map: what was done, poses `(n, 3)` of the key scans, and the loops between key scans that it was made by."""

    name: str
    poses: Floats
    loops: Edges


def loop_graph(place: TrackedPlace) -> LoopGraph:
    """The graph of a tracked place; every third node of two passages is joined."""
    nodes = np.flatnonzero(np.diff(np.floor(cumulative_distance(place.track) / NODE_M), prepend=-1.0) > 0)
    nodes[0] = 0
    steps = se2.between(place.track[nodes[:-1]], place.track[nodes[1:]])
    std = np.sqrt(np.hypot(steps[:, 0], steps[:, 1]) + 0.5)[:, None] * STEP_STD_PER_SQRT_M
    count = len(nodes)
    chain = _edges(np.arange(count - 1), np.arange(1, count), steps, std)
    truth = place.truth[nodes]
    travel = cumulative_distance(truth)
    pairs = cKDTree(truth[:, :2]).query_pairs(SAME_PLACE_M, output_type="ndarray")
    pairs = pairs[np.abs(travel[pairs[:, 0]] - travel[pairs[:, 1]]) > APART_M]
    pairs = pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]
    _, kept = np.unique(pairs // 3, axis=0, return_index=True)
    return LoopGraph(place, nodes, chain, pairs[np.sort(kept)])


def maps_of(graph: LoopGraph, seed: int) -> Iterator[MadeMap]:
    """Right and wrong maps; a truth decides which are wrong. None of a place where the robot was never twice."""
    rng = np.random.default_rng(seed)
    loops, count = graph.loops, len(graph.loops)
    if not count:
        return
    none = np.zeros((count, 3))
    closed = close_trajectory(graph.place.scans, graph.place.track)
    yield MadeMap("as the program makes it", closed.poses, closed.loops)
    right = _map(graph, "all loops", np.ones(count, bool), none, rng)
    yield right
    yield _map(graph, "few loops", rng.random(count) < 0.3, none, rng)
    yield _map(graph, "no loops", np.zeros(count, bool), none, rng)
    yield _map(graph, "loops of the first half", loops[:, 1] < 0.5 * len(graph.nodes), none, rng)
    for axis, name in enumerate(("a bay off", "a bay off", "a corridor twice")):
        chosen = int(rng.integers(count))
        shifted = np.abs(loops - loops[chosen]).max(axis=1) < 25
        shifts = none.copy()
        shifts[shifted, axis // 2] = rng.choice([-1.0, 1.0]) * rng.uniform(*SHIFT_M)
        yield _map(graph, name, shifted | _elsewhere(loops, chosen, 40, rng), shifts, rng)
    chosen = int(rng.integers(count))
    shifts = none.copy()
    shifts[chosen, :2] = rng.uniform(-FORCED_M, FORCED_M, 2)
    kept = _elsewhere(loops, chosen, 30, rng)
    kept[chosen] = True
    yield _map(graph, "one loop forced", kept, shifts, rng)
    at = int(rng.integers(len(right.poses) // 4, 3 * len(right.poses) // 4))
    kink = rng.choice([-1.0, 1.0]) * rng.uniform(*KINK_RAD)
    yield MadeMap("a kink", kinked(right.poses, at, kink), right.loops)
    scale = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(*SCALE_ERROR)
    yield MadeMap("too large or too small", right.poses * [scale, scale, 1.0], right.loops)


def kinked(poses: Floats, at: int, yaw_rad: float) -> Floats:
    """The path `(n, 3)` with all of it after one pose rotated about that pose."""
    after = se2.between(poses[at], poses[at:])
    return np.concatenate([poses[:at], se2.compose(poses[at] + [0.0, 0.0, yaw_rad], after)])


def _elsewhere(loops: Ints, chosen: int, apart: int, rng: np.random.Generator) -> Bools:
    """A fifth of the loops that lie `apart` nodes from a chosen one."""
    return np.asarray((np.abs(loops - loops[chosen]).max(axis=1) > apart) & (rng.random(len(loops)) < 0.2))


def _map(graph: LoopGraph, name: str, kept: Bools, shifts: Floats, rng: np.random.Generator) -> MadeMap:
    """The map by the loops that are kept, each measured with noise and its shift."""
    loops, track = graph.loops[kept], graph.place.track
    if not len(loops):
        return MadeMap(name, track, Edges.none())
    truth = graph.place.truth[graph.nodes]
    motions = se2.between(truth[loops[:, 0]], truth[loops[:, 1]]) + shifts[kept]
    motions += rng.standard_normal(motions.shape) * LOOP_STD
    std = np.broadcast_to(2.0 * np.array(LOOP_STD), motions.shape)
    closures = _edges(loops[:, 0], loops[:, 1], motions, std)
    poses, _ = optimise(track[graph.nodes], Edges.concatenate([graph.steps, closures]), ROBUST_SCALE)
    closures = replace(closures, source=graph.nodes[loops[:, 0]], target=graph.nodes[loops[:, 1]])
    return MadeMap(name, distribute_corrections(track, graph.nodes, poses), closures)


def _edges(source: Ints, target: Ints, motions: Floats, std: Floats) -> Edges:
    """Edges that the robust kernel does not touch, with standard deviations `(m, 3)`."""
    information = (1.0 / std**2)[:, :, None] * np.eye(3)
    return Edges(source, target, motions, information, np.zeros(len(source), np.bool_))
