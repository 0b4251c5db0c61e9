"""Robots that roll and pitch without an IMU: their lidars swing about the path by odometry."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sway import Sway, SwayObserver, find_sway, levelled
from gridslam.logs import open_log

S = 10**9
TIMES_S = np.arange(0.0, 60.0, 0.1)
WHOLE = np.zeros(len(TIMES_S), np.int64)
HEIGHT_M = 0.5
SAMPLE = Path(__file__).parents[2] / "sample_logs" / "ispace-mcl.mcap"


def winding(times_s: np.ndarray = TIMES_S) -> np.ndarray:
    """Poses of a robot that drives curves at 0.5 m/s and now and then stands still."""
    speed = 0.5 * (np.sin(0.3 * times_s) > -0.8)
    yaw = 0.8 * np.sin(0.25 * times_s)
    steps = speed * np.gradient(times_s)
    return np.column_stack([np.cumsum(steps * np.cos(yaw)), np.cumsum(steps * np.sin(yaw)), yaw])


def swings(size_m: float) -> np.ndarray:
    """Shifts `(n, 3)` in the robot's frame: pitch and roll of different periods."""
    forward, left = np.sin(1.7 * TIMES_S + 1.0), np.sin(2.5 * TIMES_S)
    return size_m * np.column_stack([forward, left, 0.0 * TIMES_S])


def test_the_swing_of_the_lidar_is_found_and_removed() -> None:
    robot = winding()
    track = se2.compose(robot, swings(0.04))
    found = find_sway(TIMES_S, track, robot, WHOLE)
    assert found is not None
    assert found.swing_m == pytest.approx(0.04, rel=0.1)
    errors_m = np.hypot(*(found.removed_from(track) - robot)[:, :2].T)
    assert np.sqrt(np.mean(errors_m**2)) < 0.006


@pytest.mark.parametrize("scale", [0.9, 1.0, 1.1])
def test_even_paths_have_no_sway_whatever_the_scale_of_the_odometry(scale: float) -> None:
    robot = winding()
    noise = np.random.default_rng(1).normal(0.0, [0.005, 0.005, 0.001], robot.shape)
    assert find_sway(TIMES_S, robot + noise, robot * [scale, scale, 1.0], WHOLE) is None


def test_odometry_that_is_uneven_itself_shows_no_sway() -> None:
    robot = winding()
    assert find_sway(TIMES_S, robot, se2.compose(robot, swings(0.04)), WHOLE) is None


def test_a_lidar_that_sits_elsewhere_does_not_sway() -> None:
    robot = winding()
    robot[:, 2] = 1.5 * np.sin(0.9 * TIMES_S)
    track = se2.compose(robot, np.array([0.2, 0.1, 0.0]))
    assert find_sway(TIMES_S, track, robot, WHOLE) is None


def test_nothing_is_said_of_sway_without_odometry_or_with_too_little_of_it() -> None:
    robot = winding()
    track, stamps_ns = se2.compose(robot, swings(0.04)), (TIMES_S * S).astype(np.int64)
    for period_s, is_used, is_found in ((0.1, True, True), (0.5, True, False), (0.1, False, False)):
        observer = SwayObserver()
        for stamp_ns in range(0, int(stamps_ns[-1]) + S, round(period_s * S)):
            observer.add_odometry(stamp_ns)
        for pose in robot:
            observer.add_scan(pose, has_jumped=False, is_used=is_used)
        assert (observer.sway_of(stamps_ns, track) is not None) == is_found
    assert SwayObserver().sway_of(stamps_ns[:0], track[:0]) is None


def test_a_jump_of_the_odometry_parts_the_path() -> None:
    robot = winding()
    odometry = se2.compose(np.where(np.arange(len(robot))[:, None] < 300, 0.0, [3.0, 1.0, 2.0]), robot)
    observer, stamps_ns = SwayObserver(), (TIMES_S * S).astype(np.int64)
    for row, stamp_ns in enumerate(stamps_ns.tolist()):
        observer.add_odometry(stamp_ns)
        observer.add_scan(odometry[row], has_jumped=row == 300, is_used=True)
    found = observer.sway_of(stamps_ns, se2.compose(robot, swings(0.04)))
    assert found is not None
    assert found.swing_m == pytest.approx(0.04, rel=0.1)


def test_a_levelled_scan_has_no_floor_and_horizontal_distances() -> None:
    # Leaning forward by 0.1 rad: the beam ahead meets the floor at 5 m, the one behind a wall 3 m along it.
    points = np.array([[5.1, 0.0], [-2.9, 0.0], [0.1, 4.0]])
    normals = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0]])
    scan = PreparedScan(7, np.array([0.1, 0.0]), points, points, normals, points, normals)
    found = levelled(scan, np.array([0.1 * HEIGHT_M, 0.0]), HEIGHT_M)
    expected = [[0.1 - 3.0 * math.cos(0.1), 0.0], [0.1, 4.0]]
    for kept in (found.returns, found.points, found.surface):
        np.testing.assert_allclose(kept, expected, atol=1e-4)
    for kept in (found.normals, found.surface_normals):
        np.testing.assert_allclose(kept, normals[1:])


def test_the_map_of_large_swings_is_doubted_unless_its_scans_are_levelled() -> None:
    shifts = np.zeros((1, 2))
    assert Sway(shifts, 0.1).doubt is not None
    assert Sway(shifts, 0.02).doubt is None
    assert Sway(shifts, 0.1, is_levelled=True).doubt is None


def swaying_drive(z_m: float) -> tuple[list[Event], np.ndarray]:
    """Scans of a robot that rolls and pitches in a room, with the odometry of its wheels; and its poses at the scans."""
    bearings = np.linspace(-math.pi, math.pi, 180, endpoint=False)
    rays = np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros(len(bearings))])
    events: list[Event] = [
        Transform(0, "base_link", "laser", (0.0, 0.0, z_m), (1.0, 0.0, 0.0, 0.0), is_static=True)
    ]
    times_s = np.arange(0.0, 25.0, 0.1)
    robot = np.column_stack([-2.0 + 0.15 * times_s, 0.5 * np.sin(0.3 * times_s), 0.1 * np.sin(0.3 * times_s)])
    for time_s, pose in zip(times_s.tolist(), robot, strict=True):
        stamp_ns = round(time_s * S)
        tilt = Rotation.from_euler("yx", np.radians(4.0) * np.sin([1.7 * time_s, 2.5 * time_s]))
        attitude = Rotation.from_euler("z", pose[2]) * tilt
        position = pose[:2] + attitude.apply([0.0, 0.0, HEIGHT_M])[:2]
        towards = attitude.apply(rays)[:, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            ranges = (np.sign(towards) * [4.0, 3.0] - position) / towards
        x, y, yaw = pose.tolist()
        events.append(Odometry(stamp_ns, "odom", x, y, yaw))
        step = 2.0 * math.pi / len(bearings)
        events.append(
            LaserScan(
                stamp_ns, "laser", np.nanmin(ranges, axis=1).astype(np.float32), -math.pi, step, 0.05, 30.0
            )
        )
    return events, robot


@pytest.mark.parametrize("z_m", [HEIGHT_M, 0.0])
def test_the_trajectory_is_that_of_the_robot_and_not_of_its_lidar(z_m: float) -> None:
    events, robot = swaying_drive(z_m)
    odometry = OdometryConfig()
    tracker = ScanTracker(FrontEnd(odometry, 500.0), ScanConfig(), odometry, KeyScanSpacing(0.3, 0.3))
    tracker.track_all(events)
    tracker.remove_sway()
    assert tracker.sway is not None
    assert tracker.sway.is_levelled == (z_m > 0.0)
    assert tracker.sway.note in tracker.motion_notes
    found = tracker.corrected(tracker.path.key_poses).poses
    errors_m = (se2.between(found[0], found) - se2.between(robot[0], robot))[:, :2]
    assert np.hypot(*(errors_m - np.median(errors_m, axis=0)).T).mean() < 0.008
    assert np.hypot(*(np.array(tracker.path.poses) - found)[:, :2].T).max() > 0.03


def test_matching_that_slides_along_a_corridor_is_no_sway() -> None:
    odometry = OdometryConfig()
    tracker = ScanTracker(FrontEnd(odometry, 500.0), ScanConfig(), odometry, KeyScanSpacing(0.3, 0.3))
    with open_log(SAMPLE, kinds=["scan", "odom"]) as log:
        tracker.track_all(log.events())
    tracker.remove_sway()
    assert len(tracker.path.stamps_ns) > 300
    assert tracker.sway is None
