"""Scans that repeat the one before are left out while the robot moves, and stay while it stands."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.lidar_slam.sensor_checks.stale_scans import StaleScans

NS = 10**9
PERIOD_NS = NS // 10
BEARINGS = np.linspace(-2.0, 2.0, 60)


def position_m(time_s: float) -> float:
    """A robot that drives for 4 s, stands for 2 s, and drives on; it brakes and accelerates within half a second."""
    speeds = np.interp(
        np.arange(0.0, time_s, 0.01), [0.0, 3.5, 4.0, 6.0, 6.5, 10.0], [0.5, 0.5, 0.0, 0.0, 0.5, 0.5]
    )
    return float(0.01 * speeds.sum())


def events(
    given: Callable[[int], int], noise_m: float = 0.01, has_odometry: bool = True, scans: int = 100
) -> list[Event]:
    """Scans at 10 Hz, of which the k-th has the readings that were taken at the `given(k)`-th, and odometry at 20 Hz."""
    found: list[Event] = []
    for k in range(scans):
        taken = given(k)
        ranges = 4.0 - position_m(0.1 * taken) * np.cos(BEARINGS)
        ranges += np.random.default_rng(taken).normal(0.0, noise_m, len(ranges))
        scan = LaserScan(k * PERIOD_NS, "laser", ranges.astype(np.float32), -2.0, 0.068, 0.1, 20.0)
        if has_odometry:
            half = (
                Odometry(n, "odom", position_m(n / NS), 0.0, 0.0)
                for n in (scan.stamp_ns, scan.stamp_ns + PERIOD_NS // 2)
            )
            found += [next(half), scan, next(half)]
        else:
            found.append(scan)
    return found


def fresh(recorded: list[Event]) -> tuple[StaleScans, list[int]]:
    """The check, and the numbers of the scans that it passes on; all other events come too, and all in order."""
    check = StaleScans()
    passed = [e for event in recorded for e in check.process(event)]
    passed += check.flush()
    kept = {id(event) for event in passed}
    assert [id(e) for e in recorded if id(e) in kept] == [id(e) for e in passed]
    assert all(id(e) in kept for e in recorded if not isinstance(e, LaserScan))
    return check, [e.stamp_ns // PERIOD_NS for e in passed if isinstance(e, LaserScan)]


@pytest.mark.parametrize("has_odometry", [True, False])
@pytest.mark.parametrize("noise_m", [0.0, 0.01])
def test_scans_that_all_differ_are_passed_on(has_odometry: bool, noise_m: float) -> None:
    check, passed = fresh(events(lambda k: k, noise_m, has_odometry))
    assert passed == list(range(100))
    assert not check.notes


@pytest.mark.parametrize("has_odometry", [True, False])
def test_a_lidar_without_noise_repeats_its_scans_rightly_while_the_robot_stands(has_odometry: bool) -> None:
    recorded = events(lambda k: k, 0.0, has_odometry)
    same = [
        a.ranges_m.tobytes() == b.ranges_m.tobytes()
        for a, b in zip(scans_of(recorded), scans_of(recorded)[1:], strict=False)
    ]
    assert sum(same) >= 19
    check, passed = fresh(recorded)
    assert passed == list(range(100))
    assert not check.notes


@pytest.mark.parametrize("has_odometry", [True, False])
def test_of_scans_that_are_given_twice_the_second_is_left_out_while_the_robot_moves(
    has_odometry: bool,
) -> None:
    check, passed = fresh(events(lambda k: k - k % 2, has_odometry=has_odometry))
    moving = [k for k in range(99) if not 35 < k < 65]
    assert set(range(0, 100, 2)) <= set(passed)
    assert not [k for k in passed if k % 2 and k in moving]
    assert check.count == 100 - len(passed)
    assert f"{check.count} scans of laser" in check.notes[0]


@pytest.mark.parametrize("has_odometry", [True, False])
def test_a_lidar_that_freezes_gives_stale_scans(has_odometry: bool) -> None:
    check, passed = fresh(events(lambda k: 10 if 10 <= k < 30 else k, has_odometry=has_odometry))
    assert passed == [k for k in range(100) if not 10 < k < 30]
    assert "19 scans of laser" in check.notes[0]
    assert "1.1 s after the first scan" in check.notes[0]


def test_a_lidar_that_freezes_for_good_is_found_by_odometry_alone() -> None:
    frozen = events(lambda k: min(k, 80))
    assert fresh(frozen)[1] == list(range(81))
    check, passed = fresh([e for e in frozen if isinstance(e, LaserScan)])
    assert passed == list(range(100))
    assert check.notes[0].startswith("the last 19 scans of laser are one again and again")
    assert "log.end_s: 8.1" in check.notes[0]


def test_copies_with_the_same_stamp_are_left_out_of_a_robot_that_stands_too() -> None:
    recorded = [e for e in events(lambda k: k, 0.0) for _ in range(1 + isinstance(e, LaserScan))]
    check = StaleScans()
    passed = [e for event in recorded for e in check.process(event)]
    passed += check.flush()
    assert len(scans_of(passed)) == check.count == 100


def test_scans_with_hardly_a_reading_are_alike_wherever_the_robot_is() -> None:
    recorded = events(lambda k: 0)
    for scan in scans_of(recorded):
        scan.ranges_m[10:] = np.inf
    assert fresh(recorded)[1] == list(range(100))


def test_each_of_two_lidars_has_its_own_last_scan() -> None:
    first = events(lambda k: 10 if 10 <= k < 30 else k)
    other = [
        LaserScan(s.stamp_ns, "other", (s.ranges_m + 1.0).astype(np.float32), -2.0, 0.068, 0.1, 20.0)
        for s in scans_of(events(lambda k: k))
    ]
    both = sorted([*first, *other], key=lambda e: e.stamp_ns)
    check = StaleScans()
    passed = [e for event in both for e in check.process(event)]
    passed += check.flush()
    assert sum(s.frame_id == "other" for s in scans_of(passed)) == 100
    assert check.count == 19
    assert len(check.notes) == 1
    stamps = [e.stamp_ns for e in passed]
    assert stamps == sorted(stamps)


def scans_of(recorded: list[Event]) -> list[LaserScan]:
    return [e for e in recorded if isinstance(e, LaserScan)]
