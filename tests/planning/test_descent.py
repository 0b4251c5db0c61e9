"""Paths with clearance (handmap-slam, paper section 4)."""

from __future__ import annotations

import numpy as np

from gridslam.maps.distances import distances_to
from gridslam.planning.descent import Inflation, cell_costs, cost_to_go, descend_cost_to_go


def test_a_path_keeps_clear_of_obstacles_where_there_is_room() -> None:
    blocked = np.zeros((40, 60), bool)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    blocked[0:20, 30] = True
    cell_cost = cell_costs(
        distances_to(blocked), Inflation(min_clearance=2.5, inflation_radius=8.0, obstacle_weight=8.0)
    )
    cost = cost_to_go(cell_cost, np.array([[8, 50]]), (8, 10))
    path = descend_cost_to_go(cost, (10.5, 8.5))
    cells = np.floor(path).astype(int)
    clear = distances_to(blocked)[cells[:, 1], cells[:, 0]]
    assert clear.min() > 4.0
    assert np.hypot(*(path[-1] - (50.5, 8.5))) < 1.5


def test_a_gap_narrower_than_the_robot_is_closed() -> None:
    blocked = np.zeros((21, 21), bool)
    blocked[:, 10] = True
    blocked[9:12, 10] = False
    for min_clearance, is_open in ((1.5, True), (3.0, False)):
        cell_cost = cell_costs(
            distances_to(blocked), Inflation(min_clearance, inflation_radius=4.0, obstacle_weight=2.0)
        )
        cost = cost_to_go(cell_cost, np.array([[10, 18]]), (10, 2))
        assert bool(np.isfinite(cost[10, 2])) == is_open


def test_cell_costs_rise_towards_obstacles() -> None:
    distance = np.array([[0.5, 1.0, 2.0, 3.0, 4.0, 9.0]], np.float32)
    cell_cost = cell_costs(distance, Inflation(min_clearance=1.0, inflation_radius=4.0, obstacle_weight=6.0))[
        0
    ]
    assert np.isinf(cell_cost[0])
    assert cell_cost[1] == 7.0
    assert (np.diff(cell_cost[1:]) <= 0.0).all()
    assert cell_cost[4] == cell_cost[5] == 1.0
