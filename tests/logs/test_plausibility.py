"""Scans that contradict themselves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan
from gridslam.logs.checks.plausibility import ScanPlausibility
from gridslam.logs.message_counts import MessageCounts

STAMPS = [k * 100_000_000 for k in range(20)]  # ten scans a second
STEP = math.pi / 180


def scan(**changes: object) -> LaserScan:
    """Half a turn at one degree, walls at 2 to 4 m."""
    ranges = np.linspace(2.0, 4.0, 181).astype(np.float32)
    good = LaserScan(0, "laser", ranges, -math.pi / 2, STEP, 0.1, 30.0, 0.0, math.pi / 2)
    return replace(good, **changes)


def repaired(given: LaserScan) -> tuple[LaserScan, MessageCounts]:
    counts = MessageCounts()
    return ScanPlausibility(STAMPS, "/scan", counts).repaired(given), counts


@pytest.mark.parametrize(
    "good",
    [
        scan(),
        scan(angle_max_rad=math.nan),  # a format that does not say it
        scan(angle_max_rad=0.0, angle_min_rad=0.0),  # a driver that leaves both at 0
        scan(angle_max_rad=math.pi / 2 + STEP),  # a driver that means the beam behind the last
        scan(time_increment_s=0.1 / 181),  # a sweep that takes the whole period
        scan(range_max_m=math.inf),
    ],
)
def test_a_scan_without_contradictions_is_unchanged(good: LaserScan) -> None:
    found, counts = repaired(good)
    assert found is good
    assert not counts.counters


@pytest.mark.parametrize("increment", [-STEP, STEP / 2, 0.0, 2 * STEP])
def test_an_increment_against_the_limits_and_the_count_is_replaced(increment: float) -> None:
    found, counts = repaired(scan(angle_increment_rad=increment))
    assert found.angle_increment_rad == pytest.approx(STEP, rel=1e-6)
    assert counts.counters["repaired.scan.angles"] == 1
    assert "contradicts angle_min, angle_max" in counts.problems[0]


def test_a_sweep_longer_than_the_period_is_not_used() -> None:
    for increment in (0.1, 0.01, 0.1 / 181 * 1000):
        found, counts = repaired(scan(time_increment_s=increment))
        assert found.time_increment_s == 0.0
        assert counts.counters["repaired.scan.time_increment"] == 1


def test_scans_that_are_given_twice_last_as_long_as_two_of_their_periods() -> None:
    first = [scan(ranges_m=np.full(181, 2.0 + 0.1 * (k // 2), np.float32)) for k in range(20)]
    twice = ScanPlausibility(STAMPS, "/scan", MessageCounts(), first=first)
    assert twice.repaired(scan(time_increment_s=0.2 / 181)).time_increment_s > 0.0
    assert twice.repaired(scan(time_increment_s=0.4 / 181)).time_increment_s == 0.0


def test_a_range_limit_of_zero_states_nothing() -> None:
    assert repaired(scan(range_max_m=0.0))[0].range_max_m == math.inf


def test_a_value_just_below_range_max_that_many_beams_read_is_no_return() -> None:
    ranges = scan().ranges_m.copy()
    ranges[40:60] = 29.96
    found, counts = repaired(scan(ranges_m=ranges))
    assert np.isinf(found.ranges_m[40:60]).all()
    np.testing.assert_array_equal(found.ranges_m[:40], ranges[:40])
    assert counts.counters["repaired.scan.no_return_code"] == 1


def test_a_far_wall_is_no_code() -> None:
    ranges = scan().ranges_m.copy()
    ranges[40:60] = np.linspace(29.5, 29.9, 20)
    assert repaired(scan(ranges_m=ranges))[1].counters == {}


def test_a_repair_is_reported_once_and_counted_each_time() -> None:
    counts = MessageCounts()
    check = ScanPlausibility(STAMPS, "/scan", counts)
    for _ in range(3):
        check.repaired(scan(range_max_m=0.0))
    assert counts.counters["repaired.scan.range_max"] == 3
    assert len(counts.problems) == 1


def test_the_time_of_a_sweep_is_given_to_scans_that_say_none() -> None:
    check = ScanPlausibility(STAMPS, "/scan", MessageCounts(), sweep_s=0.09)
    assert check.repaired(scan()).time_increment_s == pytest.approx(0.09 / 180)
    assert check.repaired(scan(time_increment_s=1e-4)).time_increment_s == 1e-4
    assert check.repaired(scan(time_increment_s=1.0)).time_increment_s == pytest.approx(0.09 / 180)
