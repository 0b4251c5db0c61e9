"""Whether the robot touches something."""

from __future__ import annotations

from pathlib import Path

import pytest

from gridslam.simulation.driving.contact import ContactWatch, surface_distance
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import WorldConfig, validate_world


def world(**more: object) -> WorldConfig:
    """A room of 6 x 4 m; the robot of 0.25 m radius looks along x."""
    robot = {"start": [2, 2, 0], "radius_m": 0.25}
    return validate_world({"walls": [{"rectangle": [0, 0, 6, 4]}], "robot": robot, **more}, "room")


def test_the_distance_is_that_to_the_nearest_wall_box_or_pillar() -> None:
    plain = Simulator(world(), Path())
    assert surface_distance(plain, 2.0, 1.5) == pytest.approx(1.5)
    pillar = Simulator(world(cylinders=[{"centre": [3.0, 1.5], "radius_m": 0.3}]), Path())
    assert surface_distance(pillar, 2.0, 1.5) == pytest.approx(0.7)
    assert surface_distance(pillar, 3.1, 1.5) == 0.0
    box = Simulator(world(boxes=[{"centre": [3.0, 2.5], "size": [1.0, 1.0]}]), Path())
    assert surface_distance(box, 2.0, 1.7) == pytest.approx((0.5**2 + 0.3**2) ** 0.5)


def test_driving_ahead_touches_the_wall_when_the_disc_reaches_it() -> None:
    simulator = Simulator(world(), Path())
    watch = ContactWatch(simulator)
    while not watch.is_touching:
        assert simulator.time_s < 20.0
        simulator.step(5.0, 5.0)
    assert simulator.robot.x == pytest.approx(6.0 - 0.25, abs=0.012)
    assert watch.clearance_m == pytest.approx(0.0, abs=0.012)


def test_the_minimum_clearance_is_remembered() -> None:
    simulator = Simulator(world(cylinders=[{"centre": [3.0, 2.7], "radius_m": 0.2}]), Path())
    watch = ContactWatch(simulator)
    for _ in range(500):
        simulator.step(5.0, 5.0)
        assert not watch.is_touching
    assert simulator.robot.x > 3.5
    assert watch.clearance_m == pytest.approx(0.7 - 0.2 - 0.25, abs=0.01)
