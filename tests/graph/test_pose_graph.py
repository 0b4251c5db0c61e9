"""Pose graphs: derivatives, closed loops, wrong loops."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph import pose_graph
from gridslam.graph.pose_graph import Edges, optimise

Floats = NDArray[np.float64]


def circle(n: int = 40, radius_m: float = 5.0) -> Floats:
    angle = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    poses = np.stack([radius_m * np.sin(angle), radius_m * (1.0 - np.cos(angle)), angle], axis=1)
    poses[:, 2] = se2.wrap_angle(poses[:, 2])
    return poses


def edges_of(poses: Floats, pairs: list[tuple[int, int]], noise: Floats, is_loop: bool) -> Edges:
    source, target = np.array(pairs, np.int64).T
    relative = se2.compose(se2.between(poses[source], poses[target]), noise)
    information = np.tile(np.diag([1e4, 1e4, 4e4]), (len(pairs), 1, 1))
    return Edges(source, target, relative, information, np.full(len(pairs), is_loop))


def dead_reckoning(start: Floats, steps: Floats) -> Floats:
    poses = [start]
    for step in steps:
        poses.append(se2.compose(poses[-1], step))
    return np.array(poses)


def test_the_jacobians_are_the_finite_differences_of_the_errors() -> None:
    rng = np.random.default_rng(0)
    poses = rng.uniform(-2.0, 2.0, (2, 3))
    edges = edges_of(poses, [(0, 1)], rng.normal(0.0, 0.1, (1, 3)), False)
    for node, jacobian in zip((0, 1), pose_graph.jacobians(poses, edges), strict=True):
        for axis in range(3):
            moved = [poses.copy(), poses.copy()]
            moved[0][node, axis] -= 1e-6
            moved[1][node, axis] += 1e-6
            low, high = (pose_graph.residuals(p, edges)[0] for p in moved)
            np.testing.assert_allclose(jacobian[0][:, axis], (high - low) / 2e-6, atol=1e-7)


def test_perfect_edges_recover_the_truth_from_a_perturbed_start() -> None:
    truth = circle()
    n = len(truth)
    chain = edges_of(truth, [(k, k + 1) for k in range(n - 1)], np.zeros((n - 1, 3)), False)
    loops = edges_of(truth, [(0, n - 1), (5, 30)], np.zeros((2, 3)), True)
    start = se2.compose(truth, np.random.default_rng(1).normal(0.0, 0.1, (n, 3)))
    start[0] = truth[0]
    found, weights = optimise(start, Edges.concatenate([chain, loops]), 2.0, max_iterations=40)
    np.testing.assert_allclose(se2.between(truth, found), 0.0, atol=1e-6)
    np.testing.assert_allclose(weights, 1.0, atol=1e-6)


@pytest.mark.parametrize("wrong", [False, True])
def test_a_loop_removes_the_drift_even_beside_a_wrong_loop(wrong: bool) -> None:
    truth = circle()
    n = len(truth)
    noise = np.tile([0.0, 0.0, 0.01], (n - 1, 1))
    chain = edges_of(truth, [(k, k + 1) for k in range(n - 1)], noise, False)
    loops = [edges_of(truth, [(0, n - 1), (1, n - 2), (0, n - 2)], np.zeros((3, 3)), True)]
    if wrong:
        loops.append(edges_of(truth, [(3, 20)], np.array([[4.0, -2.0, 1.0]]), True))
    start = dead_reckoning(truth[0], chain.T_source_target)
    found, weights = optimise(start, Edges.concatenate([chain, *loops]), 5.0)
    drift = np.hypot(*(start - truth)[:, :2].T).max()
    remaining = np.hypot(*(found - truth)[:, :2].T).max()
    assert drift > 1.0
    assert remaining < 0.15 * drift
    np.testing.assert_array_equal(found[0], truth[0])
    if wrong:
        assert weights[-1] < 0.01


def test_the_gradient_of_the_normal_equations_is_that_of_half_the_squared_errors() -> None:
    rng = np.random.default_rng(1)
    poses = circle(6)
    edges = edges_of(poses, [(0, 1), (1, 4), (4, 2)], rng.normal(0.0, 0.1, (3, 3)), False)
    weights = np.array([1.0, 0.5, 0.2])
    hessian, gradient = pose_graph.normal_equations(poses, edges, weights)
    for k in range(poses.size):
        step = np.zeros(poses.size)
        step[k] = 1e-6
        ahead, behind = (poses + sign * step.reshape(-1, 3) for sign in (1.0, -1.0))
        cost = [0.5 * float(weights @ pose_graph.chi_squared(p, edges)) for p in (ahead, behind)]
        assert gradient[k] == pytest.approx((cost[0] - cost[1]) / 2e-6, rel=1e-4, abs=1e-2)
    dense = hessian.toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-6)
    assert np.linalg.eigvalsh(dense).min() > -1e-6


def test_without_edges_the_normal_equations_are_zero() -> None:
    hessian, gradient = pose_graph.normal_equations(circle(3), Edges.none())
    assert hessian.shape == (9, 9)
    assert hessian.nnz == 0
    assert not gradient.any()
