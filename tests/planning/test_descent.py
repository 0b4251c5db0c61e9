"""Paths with clearance (handmap-slam, paper section 4)."""

from __future__ import annotations

import numpy as np

from gridslam.maps.distances import distances_to
from gridslam.planning.descent import Shyness, cost_to_go, prices, steepest_way


def test_a_path_keeps_its_distance_where_there_is_room() -> None:
    blocked = np.zeros((40, 60), bool)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    blocked[0:20, 30] = True
    price = prices(distances_to(blocked), Shyness(2.5, 8.0, 8.0))
    cost = cost_to_go(price, np.array([[8, 50]]), (8, 10))
    way = steepest_way(cost, (10.5, 8.5))
    cells = np.floor(way).astype(int)
    clear = distances_to(blocked)[cells[:, 1], cells[:, 0]]
    assert clear.min() > 4.0
    assert np.hypot(*(way[-1] - (50.5, 8.5))) < 1.5


def test_a_gap_narrower_than_the_robot_is_closed() -> None:
    blocked = np.zeros((21, 21), bool)
    blocked[:, 10] = True
    blocked[9:12, 10] = False
    for least, is_open in ((1.5, True), (3.0, False)):
        price = prices(distances_to(blocked), Shyness(least, 4.0, 2.0))
        cost = cost_to_go(price, np.array([[10, 18]]), (10, 2))
        assert bool(np.isfinite(cost[10, 2])) == is_open


def test_prices_rise_towards_obstacles() -> None:
    distance = np.array([[0.5, 1.0, 2.0, 3.0, 4.0, 9.0]], np.float32)
    price = prices(distance, Shyness(1.0, 4.0, 6.0))[0]
    assert np.isinf(price[0])
    assert price[1] == 7.0
    assert (np.diff(price[1:]) <= 0.0).all()
    assert price[4] == price[5] == 1.0
