"""The vertical by accelerations and turn rates of a robot that sways, accelerates, and has a gyro with a bias."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gridslam.logs.imu.gravity import vertical_by_gravity
from gridslam.logs.imu.readings import ImuReadings, OdometryReference

S = 10**9
TIMES = np.arange(0.0, 60.0, 0.01)
BIAS = np.array([0.004, -0.003, 0.002])


def swaying(amplitude_rad: float) -> tuple[ImuReadings, np.ndarray, np.ndarray, OdometryReference]:
    """Readings, forces and true verticals of a robot that drives rounds, speeding up and braking, and its odometry."""
    roll, pitch = amplitude_rad * np.sin(2.5 * TIMES), amplitude_rad * np.sin(1.7 * TIMES + 1.0)
    yaw, speed = 0.3 * TIMES, 0.6 * (1.0 - np.cos(0.9 * TIMES))
    attitude = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
    velocity = np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), np.zeros(len(TIMES))])
    acceleration = np.gradient(velocity, TIMES, axis=0) + np.array([0.0, 0.0, 9.81])
    turned = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / 0.01
    rates = np.vstack([turned[:1], turned]) + BIAS
    stamps = (TIMES * S).astype(np.int64)
    nothing = np.full((len(TIMES), 4), np.nan)
    forces = attitude.inv().apply(acceleration)
    path = np.cumsum(velocity[:, :2] * 0.01, axis=0)
    up = attitude.inv().apply([0.0, 0.0, 1.0])
    return ImuReadings(stamps, nothing, rates, forces), forces, up, OdometryReference(stamps, yaw, path)


def error_deg(found: np.ndarray, up: np.ndarray) -> float:
    """Root mean square angle between verticals."""
    angles = np.degrees(np.arccos(np.clip((found * up).sum(axis=1), -1.0, 1.0)))
    return float(np.sqrt(np.mean(angles**2)))


@pytest.mark.parametrize(("has_odometry", "limit_deg"), [(True, 0.2), (False, 1.5)])
def test_the_bias_of_the_gyro_and_the_robots_accelerations_do_not_tilt_the_vertical(
    has_odometry: bool, limit_deg: float
) -> None:
    readings, forces, up, odometry = swaying(np.radians(6.0))
    found = vertical_by_gravity(readings, forces, np.eye(3), odometry if has_odometry else None)
    assert error_deg(found, up) < limit_deg


def test_odometry_that_is_wrong_is_not_used() -> None:
    readings, forces, up, odometry = swaying(np.radians(6.0))
    wrong = OdometryReference(odometry.stamps_ns, odometry.yaws, -20.0 * odometry.positions)
    alone = error_deg(vertical_by_gravity(readings, forces, np.eye(3), None), up)
    assert error_deg(vertical_by_gravity(readings, forces, np.eye(3), wrong), up) == pytest.approx(alone)
