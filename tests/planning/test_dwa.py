"""The Dynamic Window Approach (handmap-slam, paper section 5)."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.planning.dwa import DifferentialDrive, DwaSettings, WheelSpeeds, choose_speeds, reachable_speeds

DRIVE = DifferentialDrive(
    radius_m=0.25, base_m=0.4, acceleration_mps2=0.6, max_speed_mps=0.6, max_yaw_rate_radps=1.2
)
SETTINGS = DwaSettings(
    period_s=0.1,
    delay_s=0.15,
    samples=11,
    prediction_s=0.7,
    margin_m=0.04,
    max_clearance_m=1.5,
    heading_weight=1.0,
    clearance_weight=0.25,
    speed_weight=0.35,
)
NO_OBSTACLES = np.zeros((0, 2))


def test_the_window_contains_exactly_what_the_acceleration_allows() -> None:
    speeds = reachable_speeds(WheelSpeeds(0.3, 0.4), DRIVE, SETTINGS)
    assert np.abs(speeds - (0.3, 0.4)).max() <= 0.06 + 1e-9
    assert (np.abs(speeds[:, 1] - speeds[:, 0]) / 0.4 <= 1.2 + 1e-9).all()
    assert (reachable_speeds(WheelSpeeds(0.6, 0.6), DRIVE, SETTINGS) <= 0.6).all()


def test_in_open_space_the_robot_speeds_up_towards_its_target() -> None:
    current = WheelSpeeds.standing()
    for _ in range(15):
        current = choose_speeds(current, np.array([3.0, 0.0]), NO_OBSTACLES, DRIVE, SETTINGS)
    assert (current.left_mps, current.right_mps) == pytest.approx((0.6, 0.6), abs=0.01)


def test_the_robot_turns_towards_a_target_beside_it() -> None:
    choice = choose_speeds(WheelSpeeds(0.2, 0.2), np.array([0.5, 2.0]), NO_OBSTACLES, DRIVE, SETTINGS)
    assert choice.right_mps > choice.left_mps


@pytest.mark.parametrize("seed", range(8))
def test_the_robot_can_always_stop_before_a_collision(seed: int) -> None:
    """DifferentialDrives among random points; each command takes effect a tenth of a second later, as in the simulator."""
    rng = np.random.default_rng(seed)
    points = rng.uniform((0.8, -1.5), (5.0, 1.5), (25, 2))
    x = y = yaw = 0.0
    current, nearest = WheelSpeeds.standing(), np.inf
    for _ in range(300):
        cos, sin = np.cos(yaw), np.sin(yaw)
        local = (points - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        target = (np.array([6.0, 0.0]) - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
        before, current = current, choose_speeds(current, target, local, DRIVE, SETTINGS)
        for k in range(10):
            left = before.left_mps + (current.left_mps - before.left_mps) * (k + 1) / 10
            right = before.right_mps + (current.right_mps - before.right_mps) * (k + 1) / 10
            forward, yaw_rate = 0.5 * (left + right), (right - left) / DRIVE.base_m
            x, y = x + 0.01 * forward * np.cos(yaw), y + 0.01 * forward * np.sin(yaw)
            yaw += 0.01 * yaw_rate
            nearest = min(nearest, float(np.hypot(*(points - (x, y)).T).min()))
    assert nearest > DRIVE.radius_m


def test_the_robot_brakes_in_front_of_a_wall() -> None:
    wall = np.column_stack([np.full(40, 0.34), np.linspace(-1.0, 1.0, 40)])
    choice = choose_speeds(WheelSpeeds(0.3, 0.3), np.array([2.0, 0.0]), wall, DRIVE, SETTINGS)
    assert (choice.left_mps, choice.right_mps) == pytest.approx((0.24, 0.24))
