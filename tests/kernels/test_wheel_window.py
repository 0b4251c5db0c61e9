"""Free ways along arcs, against a disc driven in steps of a millimetre."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.wheel_window import free_distances
from tests.reference.planning import distance_until_collision

BASE, RADIUS, MOST = 0.4, 0.25, 2.0


@pytest.mark.parametrize("seed", range(6))
def test_ways_are_those_of_driving_until_it_touches(seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacles = rng.uniform(-2.0, 2.0, (12, 2))
    obstacles = obstacles[np.hypot(*obstacles.T) > RADIUS + 0.02]
    speeds = rng.uniform(-0.6, 0.6, (25, 2))
    speeds = speeds[np.abs(speeds.sum(axis=1)) > 0.05]
    ways = free_distances(speeds, obstacles, BASE, RADIUS, MOST)
    for (left, right), way in zip(speeds, ways, strict=True):
        driven = distance_until_collision(left, right, obstacles, BASE, RADIUS, MOST)
        assert way == pytest.approx(driven, abs=0.01)


def test_turning_on_the_spot_touches_nothing() -> None:
    assert free_distances(np.array([[-0.3, 0.3]]), np.array([[0.26, 0.0]]), BASE, RADIUS, MOST)[0] == MOST


def test_what_is_touched_already_stops_only_what_drives_towards_it() -> None:
    speeds = np.array([[0.3, 0.3], [-0.3, -0.3]])
    ahead = free_distances(speeds, np.array([[0.2, 0.0]]), BASE, RADIUS, MOST)
    assert ahead.tolist() == [0.0, MOST]
