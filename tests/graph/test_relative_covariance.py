"""Covariances along the paths of a graph: against dense marginals, reversed motions, and shortcuts by loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, jacobians
from gridslam.graph.relative_covariance import directed_edges, packed, relative_covariances, unpacked
from gridslam.kernels.relative_covariance import CandidateLimits, loop_candidates

Floats = NDArray[np.float64]


def walk(n: int) -> Floats:
    rng = np.random.default_rng(5)
    poses = [np.zeros(3)]
    for _ in range(n - 1):
        poses.append(se2.compose(poses[-1], np.array([1.0, 0.1, 0.0]) + rng.normal(0.0, 0.3, 3)))
    return np.array(poses)


def edges_between(poses: Floats, pairs: list[tuple[int, int]]) -> Edges:
    rng = np.random.default_rng(7)
    source, target = np.array(pairs, np.int64).T
    root = rng.normal(0.0, 0.1, (len(pairs), 3, 3))
    covariance = root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(3)
    motions = se2.between(poses[source], poses[target])
    return Edges(source, target, motions, np.linalg.inv(covariance), np.zeros(len(pairs), np.bool_))


def dense_marginals(poses: Floats, edges: Edges, held: int) -> Floats:
    """Covariances `(n, 3, 3)` from the inverse of the whole information matrix with one node held."""
    n = len(poses)
    hessian = np.zeros((3 * n, 3 * n))
    for s, t, j_s, j_t, information in zip(
        edges.source, edges.target, *jacobians(poses, edges), edges.information, strict=True
    ):
        row = np.zeros((3, 3 * n))
        row[:, 3 * s : 3 * s + 3], row[:, 3 * t : 3 * t + 3] = j_s, j_t
        hessian += row.T @ information @ row
    free = np.delete(np.arange(3 * n), np.arange(3 * held, 3 * held + 3))
    full = np.zeros((3 * n, 3 * n))
    full[np.ix_(free, free)] = np.linalg.inv(hessian[np.ix_(free, free)])
    return np.array([full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(n)])


def test_along_a_chain_they_are_the_marginals_in_both_directions() -> None:
    poses = walk(9)
    chain = edges_between(poses, [(k, k + 1) for k in range(8)])
    for source in (0, 4, 8):
        found = relative_covariances(poses, directed_edges(9, chain), np.array([source]), np.arange(9))[0]
        np.testing.assert_allclose(found, dense_marginals(poses, chain, source), rtol=1e-9, atol=1e-12)


def test_a_loop_is_a_shortcut_and_the_covariance_remains_an_upper_bound() -> None:
    poses = walk(12)
    chain = edges_between(poses, [(k, k + 1) for k in range(11)])
    looped = Edges.concatenate([chain, edges_between(poses, [(0, 11)])])
    ends = np.array([0]), np.array([11])
    before = relative_covariances(poses, directed_edges(12, chain), *ends)[0, 0]
    after = relative_covariances(poses, directed_edges(12, looped), *ends)[0, 0]
    assert np.trace(after) < 0.5 * np.trace(before)
    exact = dense_marginals(poses, looped, 0)[11]
    assert np.linalg.eigvalsh(after - exact).min() > -1e-12


def test_six_numbers_hold_a_covariance() -> None:
    root = np.random.default_rng(0).normal(size=(4, 3, 3))
    covariance = root @ root.transpose(0, 2, 1)
    np.testing.assert_allclose(unpacked(packed(covariance)), covariance)


def test_a_return_is_a_candidate_only_as_long_as_it_is_uncertain() -> None:
    # Ten metres out and back beside the same lane, one node a metre.
    out = np.stack([np.arange(10.0), np.zeros(10), np.zeros(10)], axis=1)
    back = np.stack([np.arange(9.0, -1.0, -1.0), np.ones(10), np.full(10, np.pi)], axis=1)
    poses = np.concatenate([out, back])
    travel = np.arange(20.0)
    chain = edges_between(poses, [(k, k + 1) for k in range(19)])
    limits = CandidateLimits(
        min_travel_m=5.0, view_m=2.0, max_stds=0.0, min_std_m=0.1, max_std_m=100.0, max_gap=2, first_query=0
    )
    every, graph = np.ones(20, np.bool_), directed_edges(20, chain)
    counts, nodes, _ = loop_candidates(poses, travel, graph, limits, every, 4)
    assert counts[19] == 1
    assert nodes[19, 0] == 0
    assert counts[11] == 0
    assert loop_candidates(poses, travel, graph, limits, np.arange(20) != 0, 4)[1][19, 0] == 1
    tight = Edges(
        np.array([0]),
        np.array([19]),
        se2.between(poses[:1], poses[19:]),
        1e6 * np.eye(3)[None],
        np.ones(1, np.bool_),
    )
    graph = directed_edges(20, Edges.concatenate([chain, tight]))
    near = limits._replace(view_m=0.5, max_stds=0.0)
    assert loop_candidates(poses, travel, graph, near, every, 4)[0][19] == 0
