"""Scans whose messages state wrong angles, beside odometry that turns as the robot did."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks.scan_angles import find_wrong_angles
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import _tracker_of
from tests.small_log import wall_ranges

STEP = math.radians(1.0)
BEAMS = 271


def turning(stated_rad: float, other_rad: float = math.nan) -> tuple[list[LaserScan], Trajectory]:
    """A robot that turns on the spot, and what its lidar of 270 degrees says."""
    bearings = STEP * (np.arange(BEAMS) - BEAMS // 2)
    poses = np.array([(1.0, 0.5, 0.12 * k) for k in range(60)])
    stamps = np.arange(60, dtype=np.int64) * 100_000_000
    scans = [
        LaserScan(
            int(stamp), "laser", wall_ranges(x, y, yaw + bearings).astype(np.float32), float(bearings[0]),
            stated_rad, 0.1, 30.0, other_increment_rad=other_rad,
        )
        for stamp, (x, y, yaw) in zip(stamps, poses, strict=True)
    ]  # fmt: skip
    return scans, Trajectory(stamps, poses)


def found_in(scans: list[LaserScan], odometry: Trajectory) -> list[float]:
    build = SlamSdConfig()
    return [angles.step_rad for angles in find_wrong_angles(scans, odometry, lambda: _tracker_of(build))]


def test_half_an_increment_is_found_and_a_right_one_is_kept() -> None:
    assert found_in(*turning(STEP / 2)) == pytest.approx([STEP])
    assert found_in(*turning(STEP)) == []


def test_of_two_increments_that_a_message_states_the_odometry_chooses() -> None:
    assert found_in(*turning(1.2 * STEP, other_rad=STEP)) == pytest.approx([STEP])
    assert found_in(*turning(STEP, other_rad=1.2 * STEP)) == []


def test_only_scans_of_the_lidar_that_state_it_are_changed() -> None:
    scans, odometry = turning(STEP / 2)
    (angles,) = find_wrong_angles(scans, odometry, lambda: _tracker_of(SlamSdConfig()))
    assert angles.applied_to(scans[0]).angle_increment_rad == pytest.approx(STEP)
    other = replace(scans[0], frame_id="rear")
    assert angles.applied_to(other) is other
    assert "1 deg apart, not 0.5" in angles.note
