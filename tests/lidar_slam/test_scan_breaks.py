"""A robot that is carried in mid-log: scans that do not continue those before are said, unless a loop shows where they belong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import FrontEnd, ScanMatch
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.scan_breaks import ScanBreaks
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.simulation.driving.route import drive_route
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.world_config import validate_world

S = 10**9
NO_LOOPS = np.zeros((0, 2), np.int64)


def match(inlier_ratio: float, is_matched: bool = True) -> ScanMatch:
    return ScanMatch(np.zeros(3), inlier_ratio, is_matched)


def breaks_of(*ratios: float, points: int = 100) -> ScanBreaks:
    breaks = ScanBreaks()
    for k, ratio in enumerate(ratios):
        breaks.add(k * S, match(ratio, is_matched=ratio > 0.0), points)
    return breaks


@pytest.mark.parametrize(
    ("ratios", "stamps_s"),
    [
        ((0.9, 0.9, 0.9, 0.9, 0.9, 0.1, 0.0, 0.2, 0.9), [5]),
        ((0.9, 0.1, 0.0, 0.2, 0.9), []),
        ((0.9, 0.1, 0.9, 0.1, 0.9, 0.9, 0.9), []),
        ((0.9, 0.4, 0.4, 0.4, 0.4, 0.9), []),
        ((0.1, 0.1, 0.1, 0.9, 0.9, 0.9, 0.9, 0.9, 0.0, 0.0, 0.0, 0.0), [8]),
    ],
)
def test_several_foreign_scans_are_a_break_and_a_single_one_is_not(
    ratios: tuple[float, ...], stamps_s: list[int]
) -> None:
    assert breaks_of(*ratios).stamps_ns == [stamp_s * S for stamp_s in stamps_s]


def test_scans_of_few_points_show_no_break() -> None:
    assert not breaks_of(0.9, 0.0, 0.0, 0.0, 0.0, points=5).stamps_ns


def test_a_loop_across_a_break_shows_where_the_scans_belong() -> None:
    breaks = breaks_of(0.9, 0.9, 0.9, 0.9, 0.9, 0.1, 0.0, 0.2, 0.9)
    assert "--end 5.0" in (breaks.doubt(NO_LOOPS) or "")
    assert breaks.doubt(np.array([[6 * S, 8 * S]])) is not None
    assert breaks.doubt(np.array([[0, 8 * S]])) is None
    assert breaks_of(0.9, 0.9).doubt(NO_LOOPS) is None


def driven(start: tuple[float, float, float], route: list[tuple[float, float]]) -> list[Event]:
    """The events of a drive in one of two rooms that differ."""
    five_corners = {"points": [[20, 0], [31, 0], [33, 3], [28, 9], [20, 7], [20, 0]]}
    world = {
        "seed": 2,
        "walls": [{"rectangle": [0, 0, 6, 5]}, {"points": [[2, 5], [2, 4]]}, five_corners],
        "cylinders": [{"centre": [24, 4.5], "radius_m": 0.5}],
        "robot": {"start": start, "route": route},
        "sensors": {"lidar": {"rate_hz": 5, "beams": 181, "field_of_view_deg": 270.0}, "odometry": {"rate_hz": 10}},
    }  # fmt: skip
    drive = drive_route(Simulator(validate_world(world, "rooms"), Path()))
    return [e for e, is_truth in drive if not is_truth and isinstance(e, LaserScan | Odometry)]


def test_a_robot_that_is_carried_to_another_room_is_noticed() -> None:
    before = driven((1.0, 1.0, 0.0), [(4.5, 1.0), (4.5, 3.5)])
    after = driven((22.0, 2.0, 0.0), [(28.0, 2.0), (28.0, 6.0)])
    end_ns = before[-1].stamp_ns
    last = next(e for e in reversed(before) if isinstance(e, Odometry)).pose
    shifted: list[Event] = []
    for event in after:
        event = replace(event, stamp_ns=event.stamp_ns - after[0].stamp_ns + end_ns + S // 10)
        if isinstance(event, Odometry):
            x, y, yaw = se2.compose(last, event.pose).tolist()
            event = replace(event, x_m=x, y_m=y, yaw_rad=yaw)
        shifted.append(event)
    for events, is_said in ((before, False), (before + shifted, True)):
        odometry = OdometryConfig()
        tracker = ScanTracker(FrontEnd(odometry, 100.0), ScanConfig(), odometry, KeyScanSpacing(0.25, 0.25))
        tracker.track_all(events)
        assert ("do not continue those before" in (tracker.sensor_doubt(Edges.none()) or "")) is is_said
