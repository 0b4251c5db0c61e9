from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.kernels.infrared import wall_lines as kernel
from gridslam.methods.ir_scan.lines import moments_of
from gridslam.methods.ir_scan.wall_equations import by_cell, eliminate_walls
from tests.reference import wall_lines as reference

Floats = NDArray[np.float64]

CRITERIA = kernel.WallCriteria(min_points=4.0, max_thickness_m=0.05, map_variance=1e-5, robust_sigmas=2.5)
CELL_M = 0.15


def directions_of(rng: np.random.Generator, n: int) -> Floats:
    angles = rng.uniform(-np.pi, np.pi, n)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def wall_points(rng: np.random.Generator, n: int) -> Floats:
    """Points near two walls, and a few anywhere."""
    along, offset = rng.uniform(0.0, 2.0, n), rng.normal(0.0, 0.01, n)
    points = np.where(
        rng.random(n)[:, None] < 0.5, np.stack([along, 0.7 + offset], 1), np.stack([1.1 + offset, along], 1)
    )
    anywhere = rng.random(n) < 0.04
    points[anywhere] = rng.uniform(0.0, 2.0, (int(anywhere.sum()), 2))
    return points


@pytest.mark.parametrize("seed", range(3))
def test_pooled_sums_agree_with_the_reference(seed: int) -> None:
    rng = np.random.default_rng(seed)
    channels, cells = rng.standard_normal((12, 17, 3)), rng.integers(-6, 22, (30, 2))
    assert np.allclose(kernel.pooled_sums(channels, cells, 2), reference.pooled_sums(channels, cells, 2))


@pytest.mark.parametrize("seed", range(5))
def test_equations_of_a_pose_agree_with_the_reference(seed: int) -> None:
    """The kernel fits lines to the moments of cells, the reference to the points themselves."""
    rng = np.random.default_rng(seed)
    mapped, weights = wall_points(rng, 300), rng.uniform(0.5, 2.0, 300)
    mapped_cells = np.floor(mapped[:, ::-1] / CELL_M).astype(np.int64)
    sums = np.zeros((16, 16, 7))
    np.add.at(sums, (mapped_cells[:, 0], mapped_cells[:, 1]), moments_of(mapped, weights))
    position, n = np.array([0.9, 0.4]), 60
    points = wall_points(rng, n) + rng.normal(0.0, 0.02, 2)
    beams = kernel.MapPoints(points - position, directions_of(rng, n), rng.uniform(1e-5, 1e-3, (n, 2)))
    cells = np.floor(points[:, ::-1] / CELL_M).astype(np.int64)
    hessian, gradient, on_walls = reference.equations_on_lines(
        mapped, weights, CELL_M, position, beams, CRITERIA
    )
    assert on_walls > 5
    found = kernel.equations_on_lines(sums, cells, beams, position, CRITERIA)
    assert np.allclose(found.hessian, hessian, rtol=1e-6)
    assert np.allclose(found.gradient, gradient, rtol=1e-6, atol=1e-6 * np.abs(hessian).max())
    assert found.on_walls == on_walls


@pytest.mark.parametrize("seed", range(5))
def test_eliminating_the_walls_is_the_schur_complement_of_the_whole_problem(seed: int) -> None:
    """The reference has one row for each point, over all poses and all walls' offsets and tilts."""
    rng = np.random.default_rng(seed)
    n, stops = 400, 5
    positions, stop = wall_points(rng, n), np.sort(rng.integers(0, stops, n))
    arms, directions = rng.normal(0.0, 0.5, (n, 2)), directions_of(rng, n)
    variances, bel = rng.uniform(1e-5, 1e-3, (n, 2)), rng.choice([0.5, 1.0], n)
    points = kernel.StopPoints(stop, positions, bel, kernel.MapPoints(arms, directions, variances))
    first, order = by_cell(positions, CELL_M, 0.5)
    walls = len(first) - 1
    J, distance, weights = reference.rows_of_walls(first, order, points, stops, CRITERIA)
    assert np.count_nonzero(weights) > 50
    H, g = J.T @ (weights[:, None] * J), J.T @ (weights * distance)
    p = 3 * stops
    of_walls = np.linalg.inv(H[p:, p:] + np.eye(2 * walls))
    equations = kernel.equations_of_walls(first, order, points, stops, CRITERIA)
    hessian, gradient = eliminate_walls(equations)
    scale = np.abs(H[:p, :p]).max()
    assert np.allclose(hessian.toarray(), H[:p, :p] - H[:p, p:] @ of_walls @ H[p:, :p], atol=1e-9 * scale)
    assert np.allclose(gradient, g[:p] - H[:p, p:] @ of_walls @ g[p:], atol=1e-9 * scale)


def test_points_are_sorted_by_cell_and_keep_their_order_within_a_cell() -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2))
    first, order = by_cell(points, 0.5, 0.0)
    assert sorted(order.tolist()) == list(range(50))
    cells = np.floor(points / 0.5)
    seen = set()
    for a, b in pairwise(first.tolist()):
        members = order[a:b]
        assert (np.diff(members) > 0).all()
        (cell,) = {tuple(c) for c in cells[members].tolist()}
        assert cell not in seen
        seen.add(cell)
