from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.random import random_stream
from gridslam.simulation.people import Walker
from gridslam.simulation.shapes import Person


def walker(seed: int = 0, **changes: object) -> Walker:
    return Walker(
        Person.model_validate({"path": [[0, 0], [4, 0], [4, 3]], **changes}), random_stream(seed, "person")
    )


def test_a_person_walks_the_path_and_back() -> None:
    it = walker(speed_mps=1.0, speed_deviation_mps=0.0)
    assert it.pose(2.0) == pytest.approx((2.0, 0.0, 0.0))
    assert it.pose(5.0) == pytest.approx((4.0, 1.0, np.pi / 2))
    assert it.pose(8.0) == pytest.approx((4.0, 2.0, -np.pi / 2))
    assert it.pose(14.0 + 2.0) == pytest.approx((2.0, 0.0, 0.0))


def test_speeds_have_the_mean_and_deviation_of_the_world_file() -> None:
    it = walker(speed_mps=1.0, speed_deviation_mps=0.2)
    distances = np.array([it.distance_m(t) for t in np.arange(0.0, 3000.0, 0.1)])
    speeds = np.diff(distances) / 0.1
    independent = 3000.0 / (2 * 3.0)  # neighbouring speeds are alike over three seconds
    assert speeds.mean() == pytest.approx(1.0, abs=4 * 0.2 / np.sqrt(independent))
    assert speeds.std() == pytest.approx(0.2, rel=4 / np.sqrt(2 * independent))


def test_where_a_person_is_does_not_depend_on_when_it_was_asked_before() -> None:
    often, once = walker(3), walker(3)
    for t in np.arange(0.0, 50.0, 0.37):
        often.pose(float(t))
    assert often.pose(50.0) == once.pose(50.0)


def test_both_legs_remain_near_the_body() -> None:
    it = walker()
    for t in np.arange(0.0, 20.0, 0.25):
        x, y, _ = it.pose(float(t))
        assert np.hypot(*(it.legs(float(t))[:, :2] - [x, y]).T).max() < 0.35
