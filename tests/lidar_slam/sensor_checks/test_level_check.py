"""Whether scans stay levelled: by the evenness of the robot's path."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gridslam.core.messages import Event, LaserScan, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of
from gridslam.lidar_slam.sensor_checks.level_check import LevelledScans, Levelling, unevenness_m

S = 10**9
HEIGHT_M = 0.8
BEARINGS = np.linspace(-math.pi, math.pi, 120, endpoint=False)
HALF_SIZES_M = np.array([4.0, 3.0])


def tracker() -> ScanTracker:
    odometry = OdometryConfig()
    return ScanTracker(FrontEnd(odometry, 500.0), ScanConfig(), odometry, KeyScanSpacing(0.3, 0.3))


def drive(moves_with_tilt: bool, reported_sign: float) -> list[Event]:
    """Scans of a robot that drives along a room and pitches; `reported_sign` times its tilt is what the scans are levelled by."""
    extrinsics = Transform(
        0, "base_link", "laser", (0.0, 0.0, HEIGHT_M), (1.0, 0.0, 0.0, 0.0), is_static=True
    )
    events: list[Event] = [extrinsics]
    rays = np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS), np.zeros(len(BEARINGS))])
    for k in range(220):
        tilt = Rotation.from_euler("y", math.radians(5.0) * math.sin(0.3 * k))
        reported = Rotation.from_euler("y", reported_sign * math.radians(5.0) * math.sin(0.3 * k))
        position = np.array([-2.0 + 0.015 * k, 0.5]) + moves_with_tilt * tilt.apply([0.0, 0.0, HEIGHT_M])[:2]
        towards = tilt.apply(rays)[:, :2]
        with np.errstate(divide="ignore"):
            ranges = (np.sign(towards) * HALF_SIZES_M - position) / towards
        frame, (x, y, z, w) = f"laser@{k}", reported.as_quat().tolist()
        lever = tuple(reported.apply([0.0, 0.0, HEIGHT_M]).tolist())
        events.append(Transform(k * S // 10, "base_link", frame, lever, (w, x, y, z), is_static=True))
        step = 2.0 * math.pi / len(BEARINGS)
        events.append(
            LaserScan(k * S // 10, frame, ranges.min(axis=1).astype(np.float32), -math.pi, step, 0.05, 30.0)
        )
    return events


@pytest.mark.parametrize(
    ("moves_with_tilt", "reported_sign", "expected"),
    [(True, 1.0, Levelling.BASE), (False, 1.0, Levelling.LIDAR), (True, -1.0, Levelling.NONE)],
)
def test_scans_are_levelled_by_what_makes_the_path_even(
    moves_with_tilt: bool, reported_sign: float, expected: Levelling
) -> None:
    events = drive(moves_with_tilt, reported_sign)
    found = LevelledScans.among(events).decided(events, tracker)
    if expected is Levelling.NONE:  # the lidar levelled in place by a wrong tilt is about as even
        assert found.by is not Levelling.BASE
    else:
        assert found.by is expected
    assert (found.note is None) == (found.by is Levelling.BASE)


def test_scans_of_lidars_on_joints_and_few_scans_are_left_as_they_are() -> None:
    events = drive(True, -1.0)
    assert LevelledScans.among(events[1:]).extrinsics == {}
    few = LevelledScans.among(events[:30])
    assert few.decided(events[:30], tracker) == few


def test_what_is_undone_of_levelling() -> None:
    events = drive(True, 1.0)
    levels = LevelledScans.among(events)
    assert all(levels.applied_to(event) is event for event in events)
    plain = replace(levels, by=Levelling.NONE)
    in_place = replace(levels, by=Levelling.LIDAR)
    for event in events[1:]:
        if isinstance(event, LaserScan):
            assert plain.applied_to(event).frame_id == lidar_of(event) == "laser"
            assert in_place.applied_to(event) is event
        elif isinstance(event, Transform):
            assert in_place.applied_to(event).translation_m == (0.0, 0.0, HEIGHT_M)


def test_unevenness_is_the_change_of_motion() -> None:
    stamps = np.arange(200) * S // 10
    straight = np.column_stack([0.05 * np.arange(200), np.zeros(200), np.zeros(200)])
    assert unevenness_m(Trajectory(stamps, straight)) == pytest.approx(0.0, abs=1e-9)
    swaying = straight + np.column_stack([0.04 * np.sin(0.3 * np.arange(200)), np.zeros((200, 2))])
    assert unevenness_m(Trajectory(stamps, swaying)) > 0.02
    assert unevenness_m(Trajectory(stamps[:50], straight[:50])) is None
