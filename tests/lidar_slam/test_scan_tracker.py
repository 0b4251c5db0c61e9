"""Tracking a whole log of events, with and without odometry."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Imu, LaserScan, Odometry, Transform
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.logs.rotations import from_euler
from gridslam.motion.scan_poses import PlacedScan
from tests.methods.slam_sd import hall

Floats = NDArray[np.float64]


def tracked(events: Iterable[Event]) -> ScanTracker:
    """A tracker that has processed all events."""
    odometry = OdometryConfig()
    tracker = ScanTracker(FrontEnd(odometry, 100.0), ScanConfig(), odometry, KeyScanSpacing(0.25, 0.25))

    def track(placed_scans: Iterable[PlacedScan]) -> None:
        for placed in placed_scans:
            scan = tracker.prepare(placed)
            tracker.track(placed, scan)
            if tracker.is_key_scan_due:
                tracker.add_key_scan(scan)

    for event in events:
        track(tracker.process(event))
    track(tracker.flush())
    return tracker


def errors_of(tracker: ScanTracker, laps: int = 1) -> tuple[float, float]:
    """Largest errors of the path's poses: m and rad."""
    difference = se2.between(hall.path(laps), np.array(tracker.path.poses))
    return float(np.hypot(*difference[:, :2].T).max()), float(np.abs(difference[:, 2]).max())


def gyro(rates_of: Floats, bias_radps: float, sign: float = 1.0) -> list[Event]:
    """Yaw rates at ten times the rate of the scans, constant between two scans."""
    steps = se2.wrap_angle(np.diff(rates_of)) / (hall.PERIOD_NS * 1e-9)
    period_ns = hall.PERIOD_NS // 10
    start = 1_000_000_000
    return [
        Imu(start + k * period_ns, "imu", sign * float(steps[min(k // 10, len(steps) - 1)]) + bias_radps)
        for k in range(10 * len(steps) + 1)
    ]


def by_stamp(*streams: Iterable[Event]) -> list[Event]:
    return sorted((e for stream in streams for e in stream), key=lambda e: e.stamp_ns)


def scans(laps: int = 1) -> list[Event]:
    return [e for e in hall.events(laps) if isinstance(e, LaserScan)]


def test_a_log_without_odometry_is_tracked_as_well_as_with_it() -> None:
    with_odometry = tracked(hall.events(1))
    without = tracked(scans())
    assert len(without.path.poses) == len(hall.path(1))
    assert errors_of(without)[0] < max(2.0 * errors_of(with_odometry)[0], 0.1)
    assert without.counters["scan.without_odometry"] == len(hall.path(1))
    assert list(without.motion_measures) == ["constant_velocity"]
    assert without.motion_doubt is None


def test_scans_after_the_odometry_has_ended_are_tracked_without_it() -> None:
    cut_ns = 1_000_000_000 + 100 * hall.PERIOD_NS
    events = [e for e in hall.events(1) if isinstance(e, LaserScan) or e.stamp_ns < cut_ns]
    tracker = tracked(events)
    assert errors_of(tracker)[0] < 0.1
    assert tracker.counters["scan.without_odometry"] > 100
    assert {"odometry", "constant_velocity"} == set(tracker.motion_measures)


def test_odometry_that_starts_late_is_joined_without_a_jump() -> None:
    start_ns = 1_000_000_000 + 100 * hall.PERIOD_NS
    events = [e for e in hall.events(1) if isinstance(e, LaserScan) or e.stamp_ns > start_ns]
    assert errors_of(tracked(events))[0] < 0.1


def test_a_gyro_predicts_the_heading_and_its_bias_is_found() -> None:
    tracker = tracked(by_stamp(gyro(hall.path(1)[:, 2], bias_radps=0.05), scans()))
    assert errors_of(tracker)[0] < 0.1
    measures = tracker.motion_measures
    assert tracker.motion_notes == []
    assert measures["gyro_and_constant_velocity"]["predicted_scans"] > 0.9 * len(hall.path(1))
    assert (
        measures["gyro_and_constant_velocity"]["rms_error_rad"]
        < 0.5 * measures["constant_velocity"]["rms_error_rad"]
    )


def test_a_gyro_of_the_wrong_sign_is_found_out_and_not_used() -> None:
    tracker = tracked(by_stamp(gyro(hall.path(1)[:, 2], bias_radps=0.0, sign=-1.0), scans()))
    assert errors_of(tracker)[0] < 0.1
    measures = tracker.motion_measures
    assert (
        measures["constant_velocity"]["predicted_scans"]
        > measures["gyro_and_constant_velocity"]["predicted_scans"]
    )
    assert ["yaw rate contradicts the scans" in line for line in tracker.motion_notes] == [True]


def test_a_robot_that_turns_far_during_a_gap_in_the_scans_is_found_again_without_odometry() -> None:
    quarter = int(np.flatnonzero(hall.path(1)[:, 2] > 0.1)[0])  # the first corner
    gap = range(quarter - 2, quarter + 16)
    kept = [e for k, e in enumerate(scans()) if k not in gap]
    tracker = tracked(kept)
    truth = np.delete(hall.path(1), list(gap), axis=0)
    difference = se2.between(truth, np.array(tracker.path.poses))
    assert np.abs(difference[:, 2]).max() < 0.1
    assert np.hypot(*difference[:, :2].T).max() < 0.2


def test_good_odometry_is_used_for_every_scan() -> None:
    tracker = tracked(hall.events(1))
    assert tracker.motion_measures["odometry"]["predicted_scans"] == len(hall.path(1))
    assert [isinstance(e, Odometry) for e in hall.events(1)].count(True) == len(hall.path(1))


def two_lidars() -> list[Event]:
    """The drive with the scans of a left and a right lidar, which stands askew and gives every second scan only."""
    yaw, half = -1.2, hall.BEAMS // 2
    all_extrinsics = [
        Transform(0, "base_link", frame, (0.0, 0.0, 0.0), from_euler(0.0, 0.0, angle), is_static=True)
        for frame, angle in (("left", 0.0), ("right", yaw))
    ]
    found: list[Event] = list(all_extrinsics)
    count = 0
    for event in hall.events(1):
        if not isinstance(event, LaserScan):
            found.append(event)
            continue
        first = event.angle_min_rad
        middle = first + half * event.angle_increment_rad
        found.append(replace(event, frame_id="left", ranges_m=event.ranges_m[half:], angle_min_rad=middle))
        if count % 2 == 0:
            ranges = event.ranges_m[:half]
            found.append(replace(event, frame_id="right", ranges_m=ranges, angle_min_rad=first - yaw))
        count += 1
    return found


@pytest.mark.parametrize("has_odometry", [True, False])
def test_the_scans_of_two_lidars_are_tracked_together(has_odometry: bool) -> None:
    events = [e for e in two_lidars() if has_odometry or not isinstance(e, Odometry)]
    tracker = tracked(events)
    stamps = np.array(tracker.path.stamps_ns)
    expected = hall.path(1)[(stamps - stamps[0]) // hall.PERIOD_NS]
    assert len(stamps) > 1.4 * len(hall.path(1))
    difference = se2.between(expected, np.array(tracker.path.poses))
    assert np.hypot(*difference[:, :2].T).max() < 0.15
    key_scans = len(tracker.path.keys)
    one = tracked(e for e in events if getattr(e, "frame_id", "") != "right")
    assert key_scans > 1.5 * len(one.path.keys)


def test_a_path_that_jumps_from_scan_to_scan_is_doubted_unless_odometry_says_so_too() -> None:
    kept = scans()[::12]
    assert "without odometry" in (tracked(kept).motion_doubt or "")
    odometry = [e for e in hall.events(1) if not isinstance(e, LaserScan)]
    assert tracked(by_stamp(odometry, kept)).motion_doubt is None
