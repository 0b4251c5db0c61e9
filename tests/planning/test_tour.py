"""Tours (handmap-slam, paper section 3.2) against all orders, and path costs around walls."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.planning.shortest_tour import exact_tour, improved_tour
from gridslam.planning.tour import path_costs, plan_tour, tour_length
from tests.reference.planning import shortest_tour_length


def table(count: int, seed: int) -> np.ndarray:
    points = np.random.default_rng(seed).uniform(0.0, 10.0, (count, 2))
    return np.asarray(np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)))


@pytest.mark.parametrize("seed", range(5))
def test_few_places_are_visited_in_the_optimal_order(seed: int) -> None:
    distances = table(8, seed)
    order = plan_tour(distances, np.random.default_rng(0))
    assert sorted(order) == list(range(8))
    assert order[0] == 0
    assert tour_length(distances, order) == pytest.approx(shortest_tour_length(distances))


@pytest.mark.parametrize("seed", range(5))
def test_local_search_is_close_to_the_optimum_of_13_places(seed: int) -> None:
    distances = table(13, seed)
    best = tour_length(distances, np.asarray(exact_tour(distances)))
    searched = tour_length(distances, np.asarray(improved_tour(distances, np.arange(13))))
    assert best <= searched + 1e-9
    assert searched <= 1.25 * best


def test_many_places_are_each_visited_once() -> None:
    distances = table(40, 1)
    order = plan_tour(distances, np.random.default_rng(0))
    assert sorted(order) == list(range(40))
    assert order[0] == 0
    assert tour_length(distances, order) < tour_length(distances, np.arange(40))


def test_one_place_and_two_are_tours() -> None:
    assert plan_tour(np.zeros((1, 1)), np.random.default_rng(0)).tolist() == [0]
    assert plan_tour(np.ones((2, 2)), np.random.default_rng(0)).tolist() == [0, 1]


def test_path_costs_go_around_walls() -> None:
    cell_cost = np.ones((21, 21), np.float32)
    cell_cost[:20, 10] = np.inf
    lengths = path_costs(cell_cost, np.array([[0, 8], [0, 12], [20, 10]]))
    np.testing.assert_allclose(lengths, lengths.T)
    assert lengths[0, 1] > 38.0  # 20 rows up and down
    cell_cost[20, 10] = np.inf
    assert np.isinf(path_costs(cell_cost, np.array([[0, 8], [0, 12]]))[0, 1])
