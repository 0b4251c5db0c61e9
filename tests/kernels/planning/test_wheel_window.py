"""Free distances along arcs against a disc driven in steps of a millimetre."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.planning.wheel_window import free_distances
from tests.reference.planning import distance_until_collision

BASE, RADIUS, MAX_DISTANCE = 0.4, 0.25, 2.0


@pytest.mark.parametrize("seed", range(6))
def test_free_distances_are_those_of_a_disc_driven_until_it_collides(seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacles = rng.uniform(-2.0, 2.0, (12, 2))
    obstacles = obstacles[np.hypot(*obstacles.T) > RADIUS + 0.02]
    speeds = rng.uniform(-0.6, 0.6, (25, 2))
    speeds = speeds[np.abs(speeds.sum(axis=1)) > 0.05]
    distances = free_distances(speeds, obstacles, BASE, RADIUS, MAX_DISTANCE)
    for (left, right), distance in zip(speeds, distances, strict=True):
        driven = distance_until_collision(left, right, obstacles, BASE, RADIUS, MAX_DISTANCE)
        assert distance == pytest.approx(driven, abs=0.01)


def test_a_disc_that_turns_on_the_spot_collides_with_nothing() -> None:
    assert (
        free_distances(np.array([[-0.3, 0.3]]), np.array([[0.26, 0.0]]), BASE, RADIUS, MAX_DISTANCE)[0]
        == MAX_DISTANCE
    )


def test_an_obstacle_inside_the_disc_stops_it_only_when_it_drives_towards_it() -> None:
    speeds = np.array([[0.3, 0.3], [-0.3, -0.3]])
    ahead = free_distances(speeds, np.array([[0.2, 0.0]]), BASE, RADIUS, MAX_DISTANCE)
    assert ahead.tolist() == [0.0, MAX_DISTANCE]
