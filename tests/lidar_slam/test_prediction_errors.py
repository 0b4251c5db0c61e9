"""Without odometry the robot's own changes of speed decide how far scans are searched for."""

from __future__ import annotations

import math

import pytest

from gridslam.lidar_slam.prediction_errors import (
    CHANGE_STDS,
    MIN_COMPARED_STEPS,
    MIN_TRANSLATION_STD_M,
    VelocityChange,
)


def test_little_is_known_of_the_first_steps() -> None:
    change = VelocityChange()
    for _ in range(MIN_COMPARED_STEPS - 1):
        change.add(0.01, 0.2)
    assert math.isinf(change.std_m(0.2))


def test_the_standard_deviation_follows_the_changes_of_speed() -> None:
    change = VelocityChange()
    for _ in range(100):
        change.add(0.02, 0.2)  # 0.1 m/s
    assert change.std_m(0.5) == pytest.approx(MIN_TRANSLATION_STD_M + CHANGE_STDS * 0.1 * 0.5)
    assert math.isinf(change.std_m(3.0))  # after a gap
