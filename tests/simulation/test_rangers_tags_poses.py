"""Infrared rangers, the RFID reader and poses err as the world file says."""

from __future__ import annotations

from math import erf, log10, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core.messages import AbsolutePose, Range, TagInventory
from gridslam.core.random import random_stream
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.infrared import read_ranges
from gridslam.simulation.sensors.sensor_config import Infrared
from gridslam.simulation.simulator import Simulator
from tests.simulation.places import driven, recorded, room

EXACT: dict[str, Any] = {
    "name": "front", "servo_deviation_deg": 0, "noise_m": 0, "noise_per_m2": 0, "beam_width_m": 0,
    "grazing_bias_m": 0, "outliers": 0, "range_max_m": 8.0,
}  # fmt: skip
POSE = np.array([3.0, 2.0, 0.0])


def readings(bearings: np.ndarray, pose: np.ndarray = POSE, **changes: Any) -> np.ndarray:
    scene = Scene(room(), Path())
    config = Infrared(**{**EXACT, **changes})
    return read_ranges(config, bearings, pose, scene, 0.0, random_stream(0, "infrared"))


def test_without_noise_an_infrared_reading_is_the_distance() -> None:
    bearings = np.radians([-60.0, -30.0, 0.0, 30.0, 60.0])
    exact = np.minimum(
        5.0 / np.cos(bearings), [2 / np.sin(np.radians(60)), 4.0, 5.0, 6.0, 3 / np.sin(np.radians(60))]
    )
    assert np.abs(readings(bearings) - exact).max() < 1e-6


def test_infrared_noise_grows_with_the_square_of_the_range() -> None:
    for distance in (1.0, 2.0):
        pose = np.array([8.0 - distance, 2.5, 0.0])
        found = readings(np.zeros(4000), pose, noise_m=0.002, noise_per_m2=0.01)
        sigma = 0.002 + 0.01 * distance**2
        assert abs(found.mean() - distance) < 4 * sigma / np.sqrt(4000)
        assert found.std() == pytest.approx(sigma, rel=4 / np.sqrt(8000))


def test_the_fraction_of_wrong_infrared_readings_is_that_of_the_world_file() -> None:
    found = readings(np.zeros(5000), outliers=0.04)
    assert abs((np.abs(found - 5.0) > 1e-9).mean() - 0.04) < 4 * sqrt(0.04 * 0.96 / 5000)


def test_readings_outside_the_valid_range_are_recorded_as_they_come() -> None:
    near = readings(np.zeros(1), np.array([7.9, 2.5, 0.0]), range_min_m=0.2)
    assert near[0] == pytest.approx(0.2**2 / 0.1)
    far = readings(np.zeros(1), range_max_m=1.5)
    assert far[0] == pytest.approx(3.0)  # twice the maximum: what the electronics show at most


def test_past_an_edge_readings_lie_between_or_beyond_both_surfaces() -> None:
    world = room(boxes=[{"centre": [4.5, 3.0], "size": [1.0, 2.0]}])  # its corner at (4, 2), straight ahead
    config = Infrared(**{**EXACT, "beam_width_m": 0.04, "edge_errors": 0.5})
    found = read_ranges(config, np.full(2000, -0.002), POSE, Scene(world, Path()), 0.0, random_stream(1, "i"))
    wrong = np.abs(found - 5.0 / np.cos(0.002)) > 1e-6
    assert wrong.mean() == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(2000))
    assert found[wrong].min() < 1.0
    assert found[wrong].max() > 5.1


def test_rangers_sweep_at_every_stop_while_the_robot_stands() -> None:
    front = {"name": "front", "seconds_per_step": 0.01}
    world = room(
        robot={"start": [1, 1, 0], "route": [[3, 1]], "stops": {"every_m": 0.5}, "arrival_m": 0.05},
        sensors={"infrared": [front]},
    )
    simulator, events = driven(world)
    taken = [event for event in events if isinstance(event, Range)]
    assert len(taken) % 121 == 0
    assert len(taken) // 121 >= 4
    for sweep in range(len(taken) // 121):
        times = [(e.stamp_ns - world.start_ns) * 1e-9 for e in taken[sweep * 121 : (sweep + 1) * 121]]
        poses = simulator.robot.poses_at(np.array(times))
        assert np.ptp(poses, axis=0).max() < 1e-12


def rounds(x: float, yaw_deg: float, count: int = 3000, **antenna: Any) -> float:
    """Fraction of rounds that read one tag on a bin at (6, 2.5) which looks towards -x."""
    settings = {"name": "a", "rate_hz": 100.0, "missed": 0.0, "false_reads": 0.0, "gain_db": 10.0, **antenna}
    world = room(
        robot={"start": [x, 2.5, yaw_deg], "wait_at_start_s": 1e6},
        sensors={"antennas": [settings], "odometry": None},
        objects=[
            {"id": "b", "pose": [6.2, 2.5, 180], "size": [0.4, 0.4], "tag": {"id": "t", "position": [0.2, 0]}}
        ],
    )
    found = [event for event in recorded(world, count) if isinstance(event, TagInventory)]
    assert len(found) == count  # empty rounds are logged too
    return float(np.mean([len(event.tag_ids) for event in found]))


@pytest.mark.parametrize(("x", "yaw_deg"), [(4.5, 0.0), (4.0, 0.0), (4.2, 40.0), (3.9, 0.0)])
def test_read_probability_follows_from_distance_and_bearing(x: float, yaw_deg: float) -> None:
    power = 10.0 - 40 * log10(6.0 - x) - 12 * (yaw_deg / 70.0) ** 2
    expected = 0.5 * (1 + erf(power / 3.0 / sqrt(2)))
    assert rounds(x, yaw_deg) == pytest.approx(
        expected, abs=4 * sqrt(expected * (1 - expected) / 3000) + 1e-3
    )


def test_a_tag_that_looks_away_is_read_less() -> None:
    assert rounds(7.4, 180.0) < 0.02 < 0.9 < rounds(5.0, 0.0)


def test_missed_and_false_reads_have_the_fractions_of_the_world_file() -> None:
    assert rounds(5.3, 0.0, missed=0.2) == pytest.approx(0.8, abs=4 * sqrt(0.16 / 3000))
    assert rounds(1.0, 180.0, false_reads=0.05) == pytest.approx(0.05, abs=4 * sqrt(0.05 / 3000))


def poses(count: int, **settings: Any) -> tuple[np.ndarray, list[AbsolutePose]]:
    world = room(sensors={"absolute_poses": {"rate_hz": 100.0, "delay_s": 0.0, **settings}, "odometry": None})
    found = [event for event in recorded(world, count) if isinstance(event, AbsolutePose)]
    return np.array([event.pose for event in found]) - [3.0, 2.0, 0.0], found


def test_absolute_poses_have_the_noise_of_their_covariance() -> None:
    errors, found = poses(4000, noise_m=0.04, noise_deg=2.0, outliers=0.0)
    sigma = np.sqrt(np.diag(found[0].covariance))
    assert sigma == pytest.approx([0.04, 0.04, np.radians(2.0)])
    assert np.abs(errors.mean(axis=0) / sigma).max() < 4 / np.sqrt(len(errors))
    assert errors.std(axis=0) / sigma == pytest.approx(np.ones(3), rel=4 / np.sqrt(2 * len(errors)))


def test_the_fraction_of_outlier_poses_is_that_of_the_world_file() -> None:
    errors, _ = poses(4000, outliers=0.05, outlier_m=2.0)
    fraction = (np.hypot(errors[:, 0], errors[:, 1]) > 0.5).mean()
    assert abs(fraction - 0.05) < 4 * sqrt(0.05 * 0.95 / 4000)


def test_absolute_poses_arrive_late_with_the_stamp_of_their_measurement() -> None:
    simulator = Simulator(
        room(sensors={"absolute_poses": {"rate_hz": 10.0, "delay_s": 0.25}, "odometry": None}), Path()
    )
    for _ in range(100):
        for event in simulator.step(0.0, 0.0):
            late = simulator.time_s - (event.stamp_ns - simulator.world.start_ns) * 1e-9
            assert late == pytest.approx(0.25, abs=0.0101)
