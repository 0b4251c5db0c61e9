"""Covariances of poses relative to one node of a pose graph, along the least uncertain path through its edges.

A covariance is six numbers: xx, xy, yy, x-yaw, y-yaw, yaw-yaw.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.threads import run_in_ranges

XX, XY, YY, XT, YT, TT = range(6)


class DirectedEdges(NamedTuple):
    """Both directions of a graph's edges: node i owns first_edge[i]..first_edge[i + 1].

    `covariance` `(m, 6)` is that of the motion along the edge, in the frame of the node that it leaves; `cost` `(m,)` > 0.
    """

    first_edge: NDArray[np.int64]
    target: NDArray[np.int64]
    covariance: NDArray[np.float64]
    cost: NDArray[np.float64]


class CandidateLimits(NamedTuple):
    """Criteria for loop candidates: nodes that may show the same place, with an uncertain relative pose.

    Candidates lie at least `min_travel_m` back on the trajectory, and within `view_m` of each other if `max_stds` standard
    deviations of their relative position are allowed for. That is between `min_std_m` and `max_std_m` in its widest direction.
    A gap of more than `max_gap` nodes begins another passage, and each passage gives one candidate. Nodes before `first_query`
    get none.
    """

    min_travel_m: float
    view_m: float
    max_stds: float
    min_std_m: float
    max_std_m: float
    max_gap: int
    first_query: int


@compiled
def _sift_up(keys: NDArray[np.float64], nodes: NDArray[np.int64], i: int) -> None:
    while i > 0:
        parent = (i - 1) // 2
        if keys[parent] <= keys[i]:
            return
        keys[parent], keys[i] = keys[i], keys[parent]
        nodes[parent], nodes[i] = nodes[i], nodes[parent]
        i = parent


@compiled
def _sift_down(keys: NDArray[np.float64], nodes: NDArray[np.int64], size: int) -> None:
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            return
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[i] <= keys[child]:
            return
        keys[child], keys[i] = keys[i], keys[child]
        nodes[child], nodes[i] = nodes[i], nodes[child]
        i = child


@compiled
def _extend(
    at: NDArray[np.float64],
    edge: NDArray[np.float64],
    yaw: float,
    dx: float,
    dy: float,
    out: NDArray[np.float64],
) -> None:
    """Covariance one edge further: the node moves by (dx, dy), the edge's noise is turned by the yaw of its frame."""
    c, s = np.cos(yaw), np.sin(yaw)
    out[XX] = at[XX] - 2.0 * dy * at[XT] + dy * dy * at[TT]
    out[XY] = at[XY] + dx * at[XT] - dy * at[YT] - dx * dy * at[TT]
    out[YY] = at[YY] + 2.0 * dx * at[YT] + dx * dx * at[TT]
    out[XT] = at[XT] - dy * at[TT]
    out[YT] = at[YT] + dx * at[TT]
    out[TT] = at[TT] + edge[TT]
    out[XX] += c * c * edge[XX] - 2.0 * c * s * edge[XY] + s * s * edge[YY]
    out[XY] += c * s * (edge[XX] - edge[YY]) + (c * c - s * s) * edge[XY]
    out[YY] += s * s * edge[XX] + 2.0 * c * s * edge[XY] + c * c * edge[YY]
    out[XT] += c * edge[XT] - s * edge[YT]
    out[YT] += s * edge[XT] + c * edge[YT]


@compiled
def _largest_variance(covariance: NDArray[np.float64]) -> float:
    """The larger eigenvalue of the position's part."""
    half = 0.5 * (covariance[XX] + covariance[YY])
    projected = np.sqrt(0.25 * (covariance[XX] - covariance[YY]) ** 2 + covariance[XY] ** 2)
    return float(half + projected)


@compiled
def covariances_from(
    source: int, poses: NDArray[np.float64], edges: DirectedEdges, max_std_m: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Covariances `(n, 6)` of all nodes' poses given the source's, axes of the map; and which nodes were reached `(n,)`.

    Dijkstra on the edges' costs; paths end where the position's standard deviation exceeds `max_std_m`. The covariance along
    one path bounds that of the whole graph from above.
    """
    n = poses.shape[0]
    best = np.full(n, np.inf)
    out = np.zeros((n, 6))
    done = np.zeros(n, np.bool_)
    room = edges.target.shape[0] + 1
    keys, nodes = np.empty(room), np.empty(room, np.int64)
    keys[0], nodes[0] = 0.0, source
    size = 1
    best[source] = 0.0
    while size:
        u = nodes[0]
        size -= 1
        keys[0], nodes[0] = keys[size], nodes[size]
        _sift_down(keys, nodes, size)
        if done[u]:
            continue
        done[u] = True
        if _largest_variance(out[u]) > max_std_m * max_std_m:
            continue
        for e in range(edges.first_edge[u], edges.first_edge[u + 1]):
            v = edges.target[e]
            cost = best[u] + edges.cost[e]
            if done[v] or cost >= best[v]:
                continue
            best[v] = cost
            dx, dy = poses[v, 0] - poses[u, 0], poses[v, 1] - poses[u, 1]
            _extend(out[u], edges.covariance[e], poses[u, 2], dx=dx, dy=dy, out=out[v])
            keys[size], nodes[size] = cost, v
            _sift_up(keys, nodes, size)
            size += 1
    return out, done


def covariances_between(
    sources: NDArray[np.int64], targets: NDArray[np.int64], poses: NDArray[np.float64], edges: DirectedEdges
) -> NDArray[np.float64]:
    """Covariances `(s, t, 6)` of the targets' poses given each source's."""
    out = np.empty((sources.shape[0], targets.shape[0], 6))
    run_in_ranges(_covariances_between, sources.shape[0], (sources, targets, poses, edges, out))
    return out


@compiled
def _covariances_between(
    first: int,
    last: int,
    sources: NDArray[np.int64],
    targets: NDArray[np.int64],
    poses: NDArray[np.float64],
    edges: DirectedEdges,
    out: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `covariances_between`."""
    for k in range(first, last):
        found = covariances_from(sources[k], poses, edges, np.inf)[0]
        for j in range(targets.shape[0]):
            copy_row(out[k], j, found[targets[j]])


@compiled
def _candidates_of(
    source: int,
    poses: NDArray[np.float64],
    travel_m: NDArray[np.float64],
    edges: DirectedEdges,
    limits: CandidateLimits,
    is_target: NDArray[np.bool_],
    nodes: NDArray[np.int64],
    covariances: NDArray[np.float64],
) -> int:
    """Fill in the candidates of one source, one a passage and the first `len(nodes)` passages; returns how many."""
    found, reached = covariances_from(source, poses, edges, 4.0 * limits.max_std_m)
    count = 0
    last = -1000000
    best_m = best_d = np.inf
    for a in range(source):
        if travel_m[source] - travel_m[a] < limits.min_travel_m:
            break
        if not (reached[a] and is_target[a]):
            continue
        variance = _largest_variance(found[a])
        if variance < limits.min_std_m**2 or variance > limits.max_std_m**2:
            continue
        dx, dy = poses[a, 0] - poses[source, 0], poses[a, 1] - poses[source, 1]
        distance = np.sqrt(dx * dx + dy * dy)
        beyond = max(distance - limits.view_m, 0.0)
        along = dx * dx * found[a, XX] + 2.0 * dx * dy * found[a, XY] + dy * dy * found[a, YY]
        std = np.sqrt(along / max(distance * distance, 1e-12) + 1e-6)
        m = beyond / std
        if m > limits.max_stds:
            continue
        if a - last > limits.max_gap:
            if count == nodes.shape[0]:
                break
            count += 1
            best_m = best_d = np.inf
        last = a
        if m < best_m or (m == best_m and distance < best_d):
            best_m, best_d = m, distance
            nodes[count - 1] = a
            copy_row(covariances, count - 1, found[a])
    return count


def loop_candidates(
    poses: NDArray[np.float64],
    travel_m: NDArray[np.float64],
    edges: DirectedEdges,
    limits: CandidateLimits,
    is_target: NDArray[np.bool_],
    max_passages: int,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """For every node the number of its candidates `(n,)`, their nodes `(n, max_passages)` and their covariances given its pose.

    The latter are `(n, max_passages, 6)`. The nodes have `poses` `(n, 3)` and the distances `travel_m` `(n,)` driven up to them,
    `edges` join them, and candidates meet the `limits`. Only the nodes that `is_target` `(n,)` marks are candidates.
    """
    n = poses.shape[0]
    counts = np.zeros(n, np.int64)
    nodes = np.zeros((n, max_passages), np.int64)
    covariances = np.zeros((n, max_passages, 6))
    run_in_ranges(
        _loop_candidates, n, (poses, travel_m, edges, limits, is_target, counts, nodes, covariances)
    )
    return counts, nodes, covariances


@compiled
def _loop_candidates(
    first: int,
    last: int,
    poses: NDArray[np.float64],
    travel_m: NDArray[np.float64],
    edges: DirectedEdges,
    limits: CandidateLimits,
    is_target: NDArray[np.bool_],
    counts: NDArray[np.int64],
    nodes: NDArray[np.int64],
    covariances: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `loop_candidates`."""
    for b in range(max(first, limits.first_query), last):
        counts[b] = _candidates_of(
            b,
            poses,
            travel_m=travel_m,
            edges=edges,
            limits=limits,
            is_target=is_target,
            nodes=nodes[b],
            covariances=covariances[b],
        )
