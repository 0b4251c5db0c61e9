"""Returns from the robot itself are found by bearing and range, named and left out; walls are not taken for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core.messages import Event, LaserScan, Transform, readonly
from gridslam.lidar_slam.sensor_checks.own_body import LaterBodies, find_own_bodies
from tests.lidar_slam.sensor_checks.test_odometry_check import checked
from tests.methods.slam_sd import hall

BEAMS = 360
STEP_RAD = 2.0 * np.pi / BEAMS


def scans(
    rng: np.random.Generator, body: slice | None, count: int = 60, roll: bool = False
) -> list[LaserScan]:
    """Scans of the whole circle whose ranges differ from each other outside of the body; `roll`: each begins elsewhere."""
    made = []
    for k in range(count):
        ranges = rng.uniform(0.3, 8.0, BEAMS)
        if body is not None:
            ranges[body] = 0.4 + rng.normal(0.0, 0.008, BEAMS)[body]
        first = 7 * k if roll else 0
        values = readonly(np.roll(ranges, -first), np.float32)
        made.append(LaserScan(k, "laser", values, -np.pi + (first + 0.5) * STEP_RAD, STEP_RAD, 0.1, 10.0))
    return made


@pytest.mark.parametrize("roll", [False, True])
def test_a_mast_is_found_and_removed_alone(roll: bool) -> None:
    given = scans(np.random.default_rng(1), slice(100, 112), roll=roll)
    (body,) = find_own_bodies(given)
    (sector,) = body.sectors
    assert sector == pytest.approx((98.5 - 180.0, 113.5 - 180.0, 0.4), abs=0.06)
    assert "laser sees the robot itself at bearings -82 to -66 deg" in body.note
    for scan in given:
        removed = np.isnan(body.removed_from(scan).ranges_m)
        first = round((scan.angle_min_rad + np.pi) / STEP_RAD - 0.5)
        assert removed[(np.arange(100, 112) - first) % BEAMS].all()
        assert removed.sum() <= 12 + 4


def test_no_body_is_found_in_random_scans_in_few_scans_and_of_a_robot_that_stands() -> None:
    rng = np.random.default_rng(2)
    assert not find_own_bodies(scans(rng, None))
    assert not find_own_bodies(scans(rng, slice(0, 10), count=10))
    still = scans(rng, slice(0, 10), count=1)[0]
    assert not find_own_bodies([replace(still, stamp_ns=k) for k in range(100)])


def test_scans_of_another_lidar_are_left_as_they_are() -> None:
    (body,) = find_own_bodies(scans(np.random.default_rng(3), slice(100, 112)))
    other = replace(scans(np.random.default_rng(4), slice(100, 112), count=1)[0], frame_id="rear")
    assert body.removed_from(other) is other


def with_handle(event: Event) -> Event:
    if not isinstance(event, LaserScan):
        return event
    ranges = event.ranges_m.copy()
    ranges[20:30] = 0.3
    return replace(event, ranges_m=readonly(ranges, np.float32))


def test_a_log_is_given_on_without_the_handle_in_view_which_is_named() -> None:
    check, given = checked([with_handle(e) for e in hall.events(1)])
    assert any("sees the robot itself" in note for note in check.notes())
    for event in given:
        if isinstance(event, LaserScan):
            assert np.isnan(event.ranges_m[20:30]).all()
            assert np.isnan(event.ranges_m).sum() <= 10 + 4


def test_a_robot_that_stands_for_long_before_it_drives_off_is_known_by_its_drive() -> None:
    """The same handle beside the same walls, of which the walls are not part of the robot although they stay for 700 scans."""
    first, *drive = [with_handle(e) for e in hall.events(1)]
    scan = drive[0]
    standing = [replace(e, stamp_ns=k * 10**8) for k in range(-700, 0) for e in (first, scan)]
    shift_ns = 10**11
    events = [replace(e, stamp_ns=e.stamp_ns + shift_ns) for e in (*standing, first, *drive)]
    check, given = checked(events)
    assert len(given) == len(events) and check.checked_scans > 700
    (body,) = check.faults.scans.own_bodies
    assert (body.limits_m > 0.0).sum() <= 10 + 4
    assert np.isnan([e for e in given if isinstance(e, LaserScan)][-1].ranges_m[20:30]).all()


def test_walls_beside_a_robot_that_stands_for_half_of_the_log_are_no_body() -> None:
    events = [e for e in hall.events(1) if not isinstance(e, Transform)]
    scan = next(e for e in events if isinstance(e, LaserScan))
    near = replace(scan, ranges_m=readonly(np.minimum(scan.ranges_m, 0.6), np.float32))
    still = [replace(near, stamp_ns=scan.stamp_ns - k) for k in range(len(events), 0, -1)]
    assert not find_own_bodies([*still, *(e for e in events if isinstance(e, LaserScan))])


@pytest.mark.parametrize("lidars", [("laser",), ("front", "rear")])
def test_a_load_that_comes_later_is_found_by_each_lidar_that_sees_it(lidars: tuple[str, ...]) -> None:
    rng, later, found = np.random.default_rng(5), LaterBodies(), []
    for k, scan in enumerate([*scans(rng, None), *scans(rng, slice(100, 112))]):
        for lidar in lidars:
            body = later.found_in(replace(scan, frame_id=lidar), 0.3 * k)
            found += [] if body is None else [(k, body.beams.frame_id)]
    assert [lidar for _, lidar in found[: len(lidars)]] == list(lidars)
    assert all(60 < k < 85 for k, _ in found[: len(lidars)])


def test_beside_a_straight_drive_a_wall_is_no_load() -> None:
    later = LaterBodies()
    given = scans(np.random.default_rng(6), slice(100, 112))
    assert all(later.found_in(scan, 0.01 * k) is None for k, scan in enumerate(given))
