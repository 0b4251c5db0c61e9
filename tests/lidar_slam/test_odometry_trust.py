"""Odometry that agrees with the scans, that stops, and that comes back."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.odometry_trust import OdometryTrust

PERIOD_NS = 100_000_000
STEP = np.array([0.06, 0.0, 0.03])


def drive(trust: OdometryTrust, steps: int, odometry_step: np.ndarray, is_firm: bool = True) -> None:
    """A robot that drives on by STEP a scan, with odometry that says another step."""
    matched = odometry = np.zeros(3)
    for k in range(steps):
        trust.add(k * PERIOD_NS, odometry, matched, is_firm)
        matched, odometry = se2.compose(matched, STEP), se2.compose(odometry, odometry_step)


def test_good_odometry_is_trusted() -> None:
    trust = OdometryTrust()
    drive(trust, 200, STEP * 1.2)
    assert trust.is_trusted
    assert trust.note is None


def test_wheels_that_stand_while_the_robot_drives_are_left_aside_until_they_turn_again() -> None:
    trust = OdometryTrust()
    drive(trust, 60, np.zeros(3))
    assert not trust.is_trusted
    trust.count()
    assert "left aside for 1 scans" in str(trust.note)
    drive(trust, 100, STEP)
    assert trust.is_trusted


def test_turned_axes_are_no_odometry() -> None:
    trust = OdometryTrust()
    drive(trust, 60, STEP * (-1.0, -1.0, 1.0))
    assert not trust.is_trusted


def test_where_matching_is_uncertain_odometry_counts() -> None:
    trust = OdometryTrust()
    drive(trust, 200, np.zeros(3), is_firm=False)
    assert trust.is_trusted
