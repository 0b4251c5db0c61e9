"""Odometry that contradicts the scans is found, named and corrected; good odometry is passed on unchanged."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gridslam.core.messages import Event, Imu, LaserScan, Odometry
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sensor_checks import fault_search
from gridslam.lidar_slam.sensor_checks.motion_windows import windows_of
from gridslam.lidar_slam.sensor_checks.odometry_calibration import calibrate
from gridslam.lidar_slam.sensor_checks.odometry_check import OdometryCheck
from gridslam.lidar_slam.sensor_checks.scan_repairs import reversed_sense
from gridslam.lidar_slam.sensor_checks.sweep_calibration import stamped_at_end
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world
from tests.methods.slam_sd import hall

NS = 10**9


def new_tracker() -> ScanTracker:
    odometry = OdometryConfig()
    return ScanTracker(FrontEnd(odometry, 100.0), ScanConfig(), odometry, KeyScanSpacing(0.25, 0.25))


def checked(events: list[Event]) -> tuple[OdometryCheck, list[Event]]:
    check = OdometryCheck(new_tracker, Stopwatch())
    given = [e for event in events for e in check.process(event)]
    return check, [*given, *check.flush()]


def winding(seconds: float = 60.0, rate_hz: float = 20.0) -> Trajectory:
    """A path of 0.5 m/s whose yaw rate changes all the time."""
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    yaw = np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)
    step = 0.5 / rate_hz
    x, y = np.cumsum(step * np.cos(yaw)), np.cumsum(step * np.sin(yaw))
    return Trajectory((t * NS).astype(np.int64), np.column_stack([x, y, yaw]))


@pytest.mark.parametrize("lag_s", [-0.3, -0.1, 0.0, 0.15, 0.3, 1.0])
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.25])
@pytest.mark.parametrize("signs", [(1, 1), (1, -1), (-1, -1)])
def test_lag_scale_and_signs_are_found_together(lag_s: float, scale: float, signs: tuple[int, int]) -> None:
    truth = winding()
    stamps = truth.stamps_ns + round(lag_s * NS)
    found = calibrate(
        windows_of(truth, Trajectory(stamps, truth.poses * [scale, scale * signs[0], signs[1]]))
    )
    assert found.lag_s == pytest.approx(lag_s, abs=0.011)
    assert found.scale == pytest.approx(1.0 / scale, rel=0.02)
    assert (found.mirrors_y, found.mirrors_yaw) == (signs[0] < 0, signs[1] < 0)
    assert bool(found.faults) == (lag_s != 0.0 or scale != 1.0 or signs != (1, 1))


@pytest.mark.parametrize("seed", range(3))
def test_a_lag_is_found_in_noise_once_there_is_motion_enough(seed: int) -> None:
    truth = winding()
    noise = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.012, len(truth)))
    noisy = truth.poses + np.column_stack([np.zeros((len(truth), 2)), noise - 0.05 * truth.poses[:, 2]])
    late = Trajectory(truth.stamps_ns + round(0.15 * NS), noisy)
    assert calibrate(windows_of(truth, Trajectory(truth.stamps_ns, noisy))).lag_s == 0.0
    assert calibrate(windows_of(truth, late)).lag_s == pytest.approx(0.15, abs=0.04)
    short = slice(0, 160)
    found = calibrate(windows_of(Trajectory(truth.stamps_ns[short], truth.poses[short]), late))
    assert found.lag_s or found.is_undecided


@pytest.mark.parametrize(
    ("lag_s", "rate_hz", "found_s"), [(0.15, 4.0, 0.0), (0.15, 20.0, 0.15), (0.3, 4.0, 0.3)]
)
def test_a_lag_shorter_than_the_period_of_the_odometry_is_no_fault(
    lag_s: float, rate_hz: float, found_s: float
) -> None:
    path, odometry = winding(), winding(rate_hz=rate_hz)
    late = Trajectory(odometry.stamps_ns + round(lag_s * NS), odometry.poses)
    assert calibrate(windows_of(path, late)).lag_s == pytest.approx(found_s, abs=0.03)


def test_a_robot_that_stands_shows_no_fault() -> None:
    stamps = np.arange(100, dtype=np.int64) * NS // 10
    still = Trajectory(stamps, np.zeros((100, 3)))
    assert not calibrate(windows_of(still, still)).faults
    assert not calibrate(windows_of(Trajectory.empty(), still)).faults


def test_good_odometry_is_given_on_unchanged_and_in_order() -> None:
    events = list(hall.events(1))
    check, given = checked(events)
    assert len(given) == len(events)
    assert all(a is b for a, b in zip(given, events, strict=True))
    assert not check.notes()
    assert check.measures()["is_corrected"] is False


def test_odometry_of_exchanged_wheels_is_corrected_and_named() -> None:
    events = [
        replace(e, y_m=-e.y_m, yaw_rad=-e.yaw_rad) if isinstance(e, Odometry) else e for e in hall.events(1)
    ]
    check, given = checked(events)
    assert "its yaw and y have the wrong sign" in check.notes()[0]
    assert "or else the lidar's beams are mirrored" in check.notes()[0]
    right = {e.stamp_ns: e for e in hall.events(1) if isinstance(e, Odometry)}
    for event in given:
        if isinstance(event, Odometry):
            np.testing.assert_allclose(event.pose, right[event.stamp_ns].pose)


@pytest.mark.parametrize(
    ("imu_sign", "says", "is_doubted"),
    [(1.0, "by the IMU as well", False), (-1.0, "", False), (None, "or else the lidar's beams", True)],
)
def test_a_map_that_may_be_mirrored_is_doubted_unless_an_imu_decides(
    imu_sign: float | None, says: str, is_doubted: bool
) -> None:
    given = [
        replace(e, y_m=-e.y_m, yaw_rad=-e.yaw_rad) if isinstance(e, Odometry) else e for e in hall.events(1)
    ]
    if imu_sign is not None:
        right = [e for e in hall.events(1) if isinstance(e, Odometry)]
        times = np.array([e.stamp_ns for e in right])
        rates = imu_sign * np.gradient(np.unwrap([e.yaw_rad for e in right]), times * 1e-9)
        given += [Imu(e.stamp_ns, "imu", wz) for e, wz in zip(right, rates.tolist(), strict=True)]
        given.sort(key=lambda e: e.stamp_ns)
    check, _ = checked(given)
    assert check.faults.scans.is_upside_down == (imu_sign == -1.0)
    assert (check.doubt is not None) == is_doubted
    assert any(says in note for note in check.notes())


def test_distances_that_differ_a_little_are_named_and_left_as_they_are() -> None:
    truth = winding()
    for ratio in (0.95, 1.05):
        found = calibrate(windows_of(truth, Trajectory(truth.stamps_ns, truth.poses / [ratio, ratio, 1.0])))
        assert not found.faults
        assert f"are {1.0 / ratio:.3g} of those by the lidar" in found.notes[0]
    assert not calibrate(
        windows_of(truth, Trajectory(truth.stamps_ns, truth.poses * [1.02, 1.02, 1.0]))
    ).notes


def test_odometry_whose_stamps_are_early_is_given_on_no_sooner_than_the_scans_need_it() -> None:
    events = [replace(e, stamp_ns=e.stamp_ns - NS) if isinstance(e, Odometry) else e for e in hall.events(1)]
    events.sort(key=lambda e: e.stamp_ns)
    check, given = checked(events)
    assert check.faults.odometry.lag_s == pytest.approx(-1.0, abs=0.05)
    stamps = [e.stamp_ns for e in given]
    assert stamps == sorted(stamps)
    assert sum(isinstance(e, LaserScan) for e in given) == len(hall.path(1))


def test_scans_that_are_late_by_their_sweep_get_the_stamps_of_its_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fault_search, "stated_sweep_s", lambda scans: 0.3)
    right = [e.stamp_ns for e in hall.events(1) if isinstance(e, LaserScan)]
    late = (
        replace(e, stamp_ns=e.stamp_ns + 3 * NS // 10) if isinstance(e, LaserScan) else e
        for e in hall.events(1)
    )
    check, given = checked(sorted(late, key=lambda e: e.stamp_ns))
    assert not check.faults.odometry.faults
    assert check.measures()["late_scans_s"] == 0.3
    assert "at the end of their sweep, 0.300 s after the first beam" in check.notes()[0]
    assert [e.stamp_ns for e in given if isinstance(e, LaserScan)] == right
    stamps = [e.stamp_ns for e in given]
    assert stamps == sorted(stamps)
    assert len(given) == len(list(hall.events(1)))


def test_a_late_scan_at_the_start_of_a_simulated_clock_has_no_stamp_before_it() -> None:
    check = OdometryCheck(new_tracker, Stopwatch())
    check.faults.scans.late_scans_s = 0.3
    scan = replace(next(e for e in hall.events(1) if isinstance(e, LaserScan)), stamp_ns=NS // 10)
    assert [e.stamp_ns for e in (*check.process(scan), *check.flush())] == [0]


@pytest.mark.parametrize(
    ("lag_s", "sweep_s", "expected"),
    [
        (-0.09, 0.1, True),
        (0.1, 0.1, False),
        (-0.2, 0.1, False),
        (-0.05, 0.0, False),
        (0.0, 0.01, False),
        (0.0, 0.0, False),
    ],
)
def test_only_a_lag_as_long_as_the_sweep_shows_stamps_of_its_end(
    lag_s: float, sweep_s: float, expected: bool
) -> None:
    assert stamped_at_end(lag_s, sweep_s) == expected


def test_odometry_decides_on_the_sense_of_scans_that_contradict_themselves() -> None:
    right = [e for e in hall.events(1) if isinstance(e, LaserScan)]
    wrong = [
        replace(reversed_sense(e), has_uncertain_sense=True) if isinstance(e, LaserScan) else e
        for e in hall.events(1)
    ]
    check, given = checked(wrong)
    assert any("that of the odometry is used" in note for note in check.notes())
    assert not check.faults.odometry.faults
    scans = [e for e in given if isinstance(e, LaserScan)]
    for found, expected in zip(scans, right, strict=True):
        assert found.angle_min_rad == pytest.approx(expected.angle_min_rad, abs=1e-5)
        assert found.angle_increment_rad == pytest.approx(expected.angle_increment_rad)


def test_good_odometry_is_kept_where_matching_alone_jumps() -> None:
    """The scans are 0.67 s apart, and between them the robot drives up to 1.2 m and turns by up to 1.3 rad."""
    corners = [(3.0, 3.0), (27.0, 3.0), (27.0, 17.0), (3.0, 17.0)]
    robot = {"start": [3.0, 3.0, 0.0], "route": [*corners[1:], *corners], "speed_mps": 1.8, "turn_radps": 2.0}
    lidar = {"rate_hz": 1.5, "beams": 181, "field_of_view_deg": 180.0, "range_max_m": 12.0}
    rooms = [{"rectangle": [0.0, 0.0, 30.0, 20.0]}, {"rectangle": [6.0, 6.0, 24.0, 14.0]}]
    world = {
        "seed": 3,
        "walls": [*rooms, {"points": [[12.0, 0.0], [12.0, 3.0]]}],
        "robot": {
            **robot,
            "wheels": {"left_radius_error": 0.005, "right_radius_error": -0.005, "max_speed_mps": 2.5},
        },
        "sensors": {"lidar": lidar, "odometry": {"rate_hz": 15}},
    }
    drive = drive_route(Simulator(validate_world(world, "sparse"), Path()))
    events = [event for event, is_truth in drive if not is_truth]
    tracker = new_tracker()
    tracker.track_all(event for event in events if not isinstance(event, Odometry))
    assert tracker.is_erratic
    assert not checked(events)[0].faults.odometry.faults
