"""Tracking from scan to scan against a local map."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.lidar_slam.config import OdometryConfig
from gridslam.lidar_slam.front_end import FrontEnd, ScanMatch
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.odometry_noise import ACCELERATION_NOISE, odometry_std
from gridslam.lidar_slam.scans import PreparedScan
from tests.lidar_slam.ring import Floats, scan_at


def tracked(
    truth: Floats, odometry: Floats, blind: range = range(0)
) -> tuple[Floats, list[ScanMatch], FrontEnd]:
    """Poses `(n, 3)` that the front end finds; scans of the indices `blind` are empty."""
    front_end = FrontEnd(OdometryConfig(), 100.0)
    poses, matches, key = [], [], None
    spacing = KeyScanSpacing(0.25, 0.25)
    for index, (pose, odom) in enumerate(zip(truth, odometry, strict=True)):
        scan = scan_at(pose, index, 0.1 if index in blind else 30.0)
        matches.append(front_end.track(scan, odom))
        poses.append(front_end.pose.copy())
        if key is None or (matches[-1].is_matched and spacing.is_due(key, front_end.pose)):
            front_end.add_key_scan(scan)
            key = front_end.pose.copy()
    return np.array(poses), matches, front_end


def straight(length_m: float) -> Floats:
    x = np.arange(0.0, length_m, 0.1)
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def test_a_straight_drive_is_followed_to_centimetres_by_odometry_that_is_five_percent_long() -> None:
    truth = straight(10.0)
    poses, matches, _ = tracked(truth, truth * [1.05, 1.0, 1.0])
    assert all(match.is_matched for match in matches)
    assert np.hypot(*(poses - truth)[:, :2].T).max() < 0.03  # odometry alone: 0.5 m
    assert np.abs(poses[:, 2]).max() < 0.003


def test_a_turn_on_the_spot_is_followed_by_odometry_that_is_ten_percent_short() -> None:
    yaw = np.linspace(0.0, np.pi / 2, 20)
    truth = np.column_stack([np.zeros((20, 2)), yaw])
    poses, matches, _ = tracked(truth, truth * 0.9)
    assert all(match.is_matched for match in matches)
    assert np.abs(se2.wrap_angle(poses[:, 2] - yaw)).max() < 0.01  # odometry alone: 0.157
    assert np.hypot(*poses[:, :2].T).max() < 0.02


def test_empty_scans_are_bridged_by_odometry() -> None:
    truth = straight(4.0)
    blind = range(15, 18)
    poses, matches, _ = tracked(truth, truth, blind)
    assert [k for k, match in enumerate(matches) if not match.is_matched] == list(blind)
    steps = np.diff(poses[14:18], axis=0)
    np.testing.assert_allclose(steps, np.diff(truth[14:18], axis=0), atol=0.003)
    assert np.hypot(*(poses[-1] - truth[-1])[:2]) < 0.02


def test_the_first_scan_is_the_origin_whatever_its_odometry() -> None:
    front_end = FrontEnd(OdometryConfig(), 100.0)
    scan: PreparedScan = scan_at(np.array([3.0, 0.0, 0.4]))
    matched = front_end.track(scan, np.array([7.0, -2.0, 1.0]))
    assert matched.is_matched
    np.testing.assert_array_equal(front_end.pose, np.zeros(3))


def test_an_unexpected_odometry_step_has_larger_standard_deviations() -> None:
    steady = np.array([0.1, 0.0, 0.0])
    config = OdometryConfig()
    as_expected = odometry_std(steady, steady, config)
    # floor 0.01 and a fifth of the distance
    np.testing.assert_allclose(as_expected[:2], 0.01 + 0.2 * 0.1)
    stuttered = odometry_std(np.array([0.3, 0.0, 0.0]), steady, config)
    assert stuttered[0] == pytest.approx(0.01 + 0.2 * 0.3 + ACCELERATION_NOISE * 0.2)


def test_a_heading_that_odometry_has_wrong_by_a_fifth_of_a_radian_is_found() -> None:
    yaw = np.array([0.0, 0.0, 0.6, 0.6])
    truth = np.column_stack([np.zeros((4, 2)), yaw])
    poses, matches, _ = tracked(truth, truth * [1.0, 1.0, 0.67])
    assert all(match.is_matched for match in matches)
    assert np.abs(se2.wrap_angle(poses[:, 2] - yaw)).max() < 0.01
