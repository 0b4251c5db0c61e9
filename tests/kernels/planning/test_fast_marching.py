"""Arrival costs against sweeps until convergence, and descent on them."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.planning.fast_marching import arrival_costs, descend_costs
from tests.reference.planning import eikonal_by_sweeps


@pytest.mark.parametrize("seed", range(4))
def test_costs_equal_those_of_sweeping_until_convergence(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell_cost = rng.uniform(1.0, 4.0, (14, 17))
    cell_cost[rng.random(cell_cost.shape) < 0.25] = np.inf
    cell_cost[3, 4] = cell_cost[10, 12] = 1.0
    ours = arrival_costs(cell_cost.astype(np.float32), np.array([3 * 17 + 4, 10 * 17 + 12]), -1, np.inf)
    reference = eikonal_by_sweeps(cell_cost, [(3, 4), (10, 12)])
    np.testing.assert_array_equal(np.isfinite(ours), np.isfinite(reference))
    reached = np.isfinite(reference)
    np.testing.assert_allclose(ours[reached], reference[reached], rtol=1e-5)


def test_in_open_space_the_cost_is_the_distance_within_the_scheme_s_error() -> None:
    cost = arrival_costs(np.ones((81, 81), np.float32), np.array([40 * 81 + 40]), -1, np.inf)
    rows, cols = np.mgrid[:81, :81]
    distance = np.hypot(rows - 40, cols - 40)
    assert (cost >= distance - 1e-4).all()  # first order upwind schemes arrive late, never early
    assert (cost <= distance * 1.05 + 1.0).all()


def test_the_front_stops_behind_the_stop_cell() -> None:
    cost = arrival_costs(np.ones((3, 100), np.float32), np.array([100]), 110, 5.0)
    assert cost[1, 10] == pytest.approx(10.0)
    assert np.isfinite(cost[1, 14])
    assert np.isinf(cost[1, 20:]).all()


def test_the_descent_goes_around_a_wall_to_the_goal_through_open_cells() -> None:
    cell_cost = np.ones((30, 30), np.float32)
    cell_cost[5:30, 15] = np.inf
    cost = arrival_costs(cell_cost, np.array([20 * 30 + 25]), -1, np.inf)
    path = descend_costs(cost, 5.5, 20.5, 0.5, 400)
    cells = np.floor(path).astype(int)
    assert np.isfinite(cell_cost[cells[:, 1], cells[:, 0]]).all()
    assert cost[cells[-1, 1], cells[-1, 0]] == 0.0
    assert path[:, 1].min() < 5.0  # above the wall's end
    length = np.hypot(*np.diff(path, axis=0).T).sum()
    shortest = np.hypot(10.0, 15.5) + np.hypot(10.0, 15.5)  # over the wall's end at (15.5, 5)
    assert length < 1.1 * shortest


def test_without_a_path_the_descent_remains_in_place() -> None:
    cost = np.full((5, 5), np.inf, np.float32)
    assert len(descend_costs(cost, 2.5, 2.5, 0.5, 50)) == 1
