"""Angles in degrees, ranges in millimetres, and the code for no return that stands alone."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan, PointCloud
from gridslam.logs.checks.plausibility import ScanPlausibility
from gridslam.logs.checks.scan_units import CloudUnits, in_radians, range_unit
from gridslam.logs.message_counts import MessageCounts

STEP = math.pi / 180
STAMPS = [k * 100_000_000 for k in range(20)]


def scan(seed: int = 0, **changes: object) -> LaserScan:
    """Half a turn at one degree with walls at 2 to 6 m."""
    ranges = np.random.default_rng(seed).uniform(2.0, 6.0, 181).astype(np.float32)
    return replace(LaserScan(0, "laser", ranges, -math.pi / 2, STEP, 0.1, 30.0), **changes)


def repaired(scans: list[LaserScan]) -> tuple[list[LaserScan], list[str]]:
    counts = MessageCounts()
    check = ScanPlausibility(STAMPS, "/scan", counts, first=scans)
    found = [check.repaired(one) for one in scans]
    assert counts.has_findings == bool(counts.problems)
    return found, counts.problems


@pytest.mark.parametrize("first", [-90.0, -math.pi / 2])
def test_an_increment_that_can_only_be_degrees_is_turned_into_radians(first: float) -> None:
    found = in_radians(scan(angle_min_rad=first, angle_increment_rad=1.0))
    assert (found.angle_min_rad, found.angle_increment_rad) == pytest.approx((-math.pi / 2, STEP), rel=1e-6)


@pytest.mark.parametrize(
    "good", [scan(), scan(angle_increment_rad=math.inf), scan(angle_increment_rad=100.0)]
)
def test_other_angles_are_unchanged(good: LaserScan) -> None:
    assert in_radians(good) is good


@pytest.mark.parametrize(
    ("per_metre", "limit", "found_limit"), [(1000, 30.0, 30.0), (1000, 30_000.0, 30.0), (100, 3000.0, 30.0)]
)
def test_ranges_in_another_unit_become_metres(per_metre: float, limit: float, found_limit: float) -> None:
    given = [scan(k, ranges_m=scan(k).ranges_m * np.float32(per_metre), range_max_m=limit) for k in range(3)]
    found, lines = repaired(given)
    np.testing.assert_allclose(found[0].ranges_m, scan(0).ranges_m, rtol=1e-6)
    assert found[0].range_max_m == pytest.approx(found_limit)
    assert len(lines) == 1 and "not in m" in lines[0]


def test_metres_remain_metres_far_away_too() -> None:
    assert range_unit([scan()]) is None
    assert range_unit([scan(ranges_m=scan().ranges_m * np.float32(50.0), range_max_m=400.0)]) is None


def test_clouds_in_millimetres_become_metres() -> None:
    points = np.random.default_rng(0).uniform(1.0, 5.0, (200, 3)).astype(np.float32)
    counts = MessageCounts()
    units = CloudUnits("/points", counts)
    cloud = PointCloud(0, "lidar", points * np.float32(1000.0), np.zeros(0, np.float32))
    np.testing.assert_allclose(units.repaired(cloud).points_m, points, rtol=1e-6)
    assert counts.has_findings
    good = PointCloud(0, "lidar", points, np.zeros(0, np.float32))
    assert CloudUnits("/points", counts).repaired(good) is good


@pytest.mark.parametrize("limit", [30.0, math.inf])
def test_a_number_that_is_the_largest_in_scan_after_scan_is_no_return(limit: float) -> None:
    given = []
    for k in range(12):
        ranges = scan(k).ranges_m.copy()
        ranges[20:60] = 12.0
        given.append(scan(k, ranges_m=ranges, range_max_m=limit))
    found, lines = repaired(given)
    assert all(np.isinf(one.ranges_m[20:60]).all() for one in found)
    assert len(lines) == 1 and "12 m in scan after scan" in lines[0]


def test_what_a_robot_that_stands_sees_again_and_again_is_no_code() -> None:
    ranges = scan().ranges_m.copy()
    ranges[20:30] = 12.0
    assert repaired([scan(ranges_m=ranges)] * 20)[1] == []


def test_a_wall_that_is_far_for_a_while_is_no_code() -> None:
    given = []
    for k in range(12):
        ranges = scan(k).ranges_m.copy()
        ranges[20:60] = np.linspace(11.7, 12.0, 40)
        given.append(scan(k, ranges_m=ranges))
    assert repaired(given)[1] == []


@pytest.mark.parametrize(
    ("lower", "upper", "found"),
    [
        (0.1, -1.0, (0.1, math.inf)),
        (0.1, math.nan, (0.1, math.inf)),
        (30.0, 0.1, (0.1, 30.0)),
        (math.nan, 0.0, (0.0, math.inf)),
    ],
)
def test_range_limits_that_say_nothing_or_are_exchanged(
    lower: float, upper: float, found: tuple[float, float]
) -> None:
    (one,), lines = repaired([scan(range_min_m=lower, range_max_m=upper)])
    assert (one.range_min_m, one.range_max_m) == found
    assert len(lines) == 1
