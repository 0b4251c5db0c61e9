"""The robot's body and its odometry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.messages import Imu, Odometry, WheelTicks
from gridslam.core.random import random_stream
from gridslam.simulation.driving.drive import STEP_S, DrivenRobot
from gridslam.simulation.driving.robot_config import Wheels
from gridslam.simulation.simulator import Simulator
from tests.simulation.places import driven, recorded, room

PERFECT = Wheels(acceleration_mps2=1e6, max_speed_mps=100.0)


def robot(wheels: Wheels, seed: int = 0) -> DrivenRobot:
    return DrivenRobot(wheels, (0.0, 0.0, 0.0), random_stream(seed, "wheels"))


def test_drives_the_circle_that_its_wheels_describe() -> None:
    it = robot(PERFECT)
    left, right = 4.0, 6.0  # 0.4 and 0.6 m/s on a base of 0.4 m: radius 1 m, 0.5 rad/s
    for _ in range(1000):
        it.step(left, right)
    assert it.yaw == pytest.approx(5.0)
    assert np.allclose([it.x, it.y], [np.sin(5.0), 1.0 - np.cos(5.0)], atol=1e-4)


def test_accelerates_no_faster_than_the_drive_can() -> None:
    it = robot(Wheels(acceleration_mps2=0.5))
    for _ in range(100):
        it.step(100.0, 100.0)
    assert it.v_mps == pytest.approx(0.5)


def test_unequal_wheels_curve_the_path() -> None:
    it = robot(Wheels(acceleration_mps2=1e6, left_radius_error=0.01, right_radius_error=-0.01))
    for _ in range(1000):
        it.step(5.0, 5.0)
    assert it.yaw == pytest.approx(-0.02 * 5.0 / 0.4)


def test_slip_has_the_mean_deviation_and_memory_of_the_world_file() -> None:
    it = robot(
        Wheels(acceleration_mps2=1e6, slip_mean=0.02, slip_deviation=0.05, slip_correlation_time_s=0.5)
    )
    lost = []
    for _ in range(40_000):
        it.step(5.0, 5.0)
        lost.append(1.0 - it.v_mps / 0.5)
    slip = np.array(lost)  # the mean of two independent wheels
    assert slip.mean() == pytest.approx(0.02, abs=4 * 0.05 / np.sqrt(2) / np.sqrt(400 / 1.0))
    assert slip.std() == pytest.approx(0.05 / np.sqrt(2), rel=0.1)
    after = round(0.5 / STEP_S)
    assert np.corrcoef(slip[:-after], slip[after:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.08)


def test_without_errors_odometry_is_the_truth() -> None:
    world = room(
        robot={"start": [1, 1, 90], "route": [[1, 3], [6, 3], [6, 1]]},
        sensors={"odometry": {"ticks_per_revolution": 0}},
    )
    simulator, events = driven(world)
    last = [event for event in events if isinstance(event, Odometry)][-1]
    believed = se2.compose([1.0, 1.0, np.pi / 2], last.pose)
    true = simulator.robot.poses_at(np.array([(last.stamp_ns - world.start_ns) * 1e-9]))[0]
    assert np.abs(se2.between(true, believed)).max() < 2e-3  # arcs between messages instead of 10 ms steps


def test_wheel_angles_are_whole_ticks() -> None:
    wheels = {"acceleration_mps2": 1e6}
    world = room(
        robot={"start": [3, 2, 0], "wheels": wheels},
        sensors={"odometry": {"ticks_per_revolution": 100, "publish_wheels": True}},
    )
    ticks = [event for event in recorded(world, 200, (3.0, 4.0)) if isinstance(event, WheelTicks)]
    revolutions = np.array([[t.left_rad, t.right_rad] for t in ticks]) * 100 / (2 * np.pi)
    assert np.abs(revolutions - np.round(revolutions)).max() < 1e-9
    times = np.array([t.stamp_ns - world.start_ns for t in ticks]) * 1e-9
    exact = times[:, None] * [3.0, 4.0] * 100 / (2 * np.pi)
    assert (np.floor(exact + 1e-6) == np.round(revolutions)).all()


def rates(seed: int, count: int, **gyro: float) -> np.ndarray:
    world = room(seed=seed, sensors={"gyro": {"rate_hz": 100.0, **gyro}, "odometry": None})
    return np.array([event.wz_radps for event in recorded(world, count) if isinstance(event, Imu)])


def test_gyro_noise_is_that_of_the_world_file() -> None:
    found = rates(0, 5000, noise_radps=0.01, bias_deviation_radps=0.0, bias_walk_radps_per_sqrt_s=0.0)
    assert abs(found.mean()) < 4 * 0.01 / np.sqrt(5000)
    assert found.std() == pytest.approx(0.01, rel=4 / np.sqrt(2 * 5000))


def test_gyro_bias_starts_and_walks_as_the_world_file_says() -> None:
    settings = {"noise_radps": 0.0, "bias_deviation_radps": 0.02, "bias_walk_radps_per_sqrt_s": 0.001}
    walks = np.array([rates(seed, 400, **settings) for seed in range(200)])
    assert walks[:, 0].std() == pytest.approx(0.02, rel=0.2)
    assert (walks[:, -1] - walks[:, 0]).std() == pytest.approx(0.001 * np.sqrt(4.0), rel=0.2)


def test_the_route_is_driven_through_every_waypoint() -> None:
    world = room(robot={"start": [1, 1, 0], "route": [[7, 1], [7, 4], [1, 4]], "laps": 2, "arrival_m": 0.1})
    simulator, _ = driven(world)
    path = simulator.robot.poses_at(np.arange(0.0, simulator.time_s, 0.05))[:, :2]
    for point in world.robot.route:
        assert np.linalg.norm(path - point, axis=1).min() < 0.1


def test_an_unreachable_waypoint_is_an_error_that_names_it() -> None:
    world = room(robot={"start": [1, 1, 0], "route": [[2, 1], [900, 1]]}, max_duration_s=20.0)
    with pytest.raises(ConfigError, match=r"waypoint 1 at \(900, 1\) is not reached within 20 s"):
        driven(world)


def test_the_same_seed_gives_the_same_events_and_another_seed_others() -> None:
    def values(seed: int) -> list[float]:
        world = room(seed=seed, sensors={"gyro": {}})
        return [event.wz_radps for event in recorded(world, 50) if isinstance(event, Imu)]

    assert values(1) == values(1)
    assert values(1) != values(2)


def test_stepping_gives_the_truth_at_any_time() -> None:
    simulator = Simulator(room(), Path())
    for _ in range(100):
        simulator.step(2.0, 2.0)
    truth = simulator.truth()
    assert truth.stamp_ns == simulator.world.start_ns + 10**9
    assert (truth.frame_id, truth.y_m) == ("map", 2.0)
    assert 3.0 < truth.x_m < 3.2


def test_a_driven_path_is_driven_open_loop() -> None:
    path = [
        {"seconds": 10, "forward_mps": 0.3},
        {"seconds": 5, "turn_radps": 0.2},
        {"seconds": 4, "forward_mps": 0.5},
    ]
    world = room(
        robot={"start": [1, 1, 0], "path": path, "wait_at_start_s": 0.5, "wheels": {"acceleration_mps2": 1e6}}
    )
    simulator, _ = driven(world)
    assert simulator.time_s == pytest.approx(19.5, abs=0.05)
    x, y, yaw = simulator.robot.pose
    assert yaw == pytest.approx(1.0, abs=0.005)
    assert np.allclose([x, y], [1 + 3 + 2 * np.cos(1.0), 1 + 2 * np.sin(1.0)], atol=0.02)


def test_a_route_and_a_path_together_are_an_error() -> None:
    with pytest.raises(ConfigError, match="robot: give either a route of waypoints or a path"):
        room(robot={"start": [1, 1, 0], "route": [[2, 2]], "path": [{"seconds": 1}]})
