"""Smooth and round corridors: the scans do not show how far the robot moved, which nothing is corrected by, and which is said."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gridslam.core.messages import Event, Odometry
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd, ScanMatch
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.open_stretches import OpenStretches
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sensor_checks.motion_windows import windows_of
from gridslam.lidar_slam.sensor_checks.odometry_calibration import calibrate
from gridslam.lidar_slam.sensor_checks.odometry_check import OdometryCheck
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world

CERTAIN = ScanMatch(np.zeros(3), 0.9, True, np.array([0.01, 0.0]))
OPEN = ScanMatch(np.zeros(3), 0.9, True, np.array([0.4, 0.0]), is_open=True)
UNMATCHED = ScanMatch(np.zeros(3), 0.0, False)
SMOOTH: dict[str, Any] = {
    "walls": [{"rectangle": [0.0, 0.0, 100.0, 2.4]}],
    "route": [(float(x), 1.2) for x in range(2, 97, 4)],
}


def round_corridor() -> dict[str, Any]:
    def circle(radius_m: float, number: int, revolutions: float) -> list[tuple[float, float]]:
        angles = np.linspace(0.0, revolutions * math.tau, number)
        return [(radius_m * math.cos(a), radius_m * math.sin(a)) for a in angles]

    return {"walls": [{"points": circle(r, 121, 1.0)} for r in (8.0, 10.5)], "route": circle(9.2, 61, 2.0)}


def driven(place: dict[str, Any], has_odometry: bool = True) -> tuple[list[Event], float]:
    """The events of a drive with good odometry, and its length (m)."""
    (x0, y0), (x1, y1), *_ = route = place["route"]
    start = (x0, y0, math.degrees(math.atan2(y1 - y0, x1 - x0)))
    world = {
        "seed": 3,
        "walls": place["walls"],
        "robot": {"start": start, "route": route[1:], "speed_mps": 1.0, "wheels": {"slip_deviation": 0.002}},
        "sensors": {
            "lidar": {"rate_hz": 5, "beams": 181, "field_of_view_deg": 180.0, "range_max_m": 6.0, "noise_m": 0.015},
            "odometry": {"rate_hz": 15},
        },
    }  # fmt: skip
    given = list(drive_route(Simulator(validate_world(world, "corridor"), Path())))
    truth = np.array([event.pose for event, is_truth in given if is_truth and isinstance(event, Odometry)])
    events = [e for e, is_truth in given if not is_truth and (has_odometry or not isinstance(e, Odometry))]
    return events, float(np.hypot(*np.diff(truth[:, :2], axis=0).T).sum())


def new_tracker() -> ScanTracker:
    odometry = OdometryConfig()
    return ScanTracker(FrontEnd(odometry, 100.0), ScanConfig(), odometry, KeyScanSpacing(0.25, 0.25))


@pytest.mark.parametrize("place", [SMOOTH, round_corridor()], ids=["smooth", "round"])
def test_featureless_walls_correct_no_odometry_and_are_said(place: dict[str, Any]) -> None:
    events, length_m = driven(place)
    check = OdometryCheck(new_tracker, Stopwatch())
    passed = [e for event in events for e in check.process(event)] + list(check.flush())
    assert not check.faults.odometry.faults
    tracker = new_tracker()
    path = tracker.track_all(passed)
    assert np.hypot(*np.diff(path.poses[:, :2], axis=0).T).sum() == pytest.approx(length_m, rel=0.03)
    assert "the scans do not show how far the robot moved" in (tracker.sensor_doubt(Edges.none()) or "")
    assert tracker.open_stretch["length_m"] > 70.0


def test_matching_without_odometry_that_slides_is_said() -> None:
    events, _ = driven(SMOOTH, has_odometry=False)
    tracker = new_tracker()
    tracker.track_all(events)
    assert "the scans do not show how far the robot moved" in (tracker.sensor_doubt(Edges.none()) or "")


@pytest.mark.parametrize(
    ("steps", "length_m"),
    [
        ([(50.0, OPEN)], 50.0),
        ([(50.0, UNMATCHED)], 50.0),
        ([(50.0, CERTAIN)], 0.0),
        ([(50.0, OPEN), (0.9, CERTAIN), (20.0, OPEN)], 70.0),
        ([(50.0, OPEN), (20.0, CERTAIN), (20.0, OPEN)], 50.0),
        ([(0.2, OPEN), (0.2, CERTAIN)] * 100, 1.2),
    ],
)
def test_a_stretch_ends_with_certain_matches_in_proportion_to_it(
    steps: list[tuple[float, ScanMatch]], length_m: float
) -> None:
    stretches = OpenStretches()
    for travel_m, match in steps:
        for _ in range(10):
            stretches.add(0.1 * travel_m, 0.1 * travel_m, match, has_odometry=True)
    assert stretches.worst.length_m == pytest.approx(length_m, abs=0.2)
    assert (stretches.doubt is not None) == (length_m > 60.0)


def test_matching_that_slides_shows_nothing_about_the_scale_of_the_odometry() -> None:
    times_s = np.arange(0.0, 80.0, 0.1)
    stamps = np.round(times_s * 1e9).astype(np.int64)
    odometry = np.column_stack([times_s, 0.0 * times_s, 0.2 * np.sin(times_s)])
    slides = times_s >= 4.0
    step = np.where(slides, 0.4, 1.0) * 0.1
    matched = np.column_stack([np.cumsum(step) - step[0], odometry[:, 1], odometry[:, 2]])
    track, by_odometry = Trajectory(stamps, matched), Trajectory(stamps, odometry)
    assert calibrate(windows_of(track, by_odometry)).scale == pytest.approx(0.4, rel=0.1)
    slid_ns = np.array([[stamps[slides][0], stamps[-1]]])
    assert calibrate(windows_of(track, by_odometry, slid_ns)).scale == 1.0
