"""Lidars that are tilted against their extrinsics: the line on which they meet the floor moves with the robot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gridslam.core.messages import LaserScan, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks.floor_line import FloorLine, find_floor_lines
from gridslam.lidar_slam.sensor_checks.own_body import beams_of
from gridslam.sensors.lidar_beams import extrinsics_of

S = 10**9
HEIGHT_M = 0.5
BEARINGS = np.linspace(-math.pi, math.pi, 180, endpoint=False)
HALF_SIZES_M = np.array([6.0, 5.0])


def scans(tilt: Rotation, count: int = 120, base: Rotation | None = None) -> list[LaserScan]:
    """Scans of a robot that drives and turns in a room; `base` is the lidar's rotation by its extrinsics."""
    rays = np.column_stack([np.cos(BEARINGS), np.sin(BEARINGS), np.zeros(len(BEARINGS))])
    step, found = 2.0 * math.pi / len(BEARINGS), []
    for k in range(count):
        position = np.array([3.0 * math.sin(0.11 * k), 2.0 * math.sin(0.07 * k)])
        sensor = Rotation.from_euler("z", 0.37 * k) * (base or Rotation.identity()) * tilt
        towards = sensor.apply(rays)
        with np.errstate(divide="ignore", invalid="ignore"):
            walls = np.nanmin((np.sign(towards[:, :2]) * HALF_SIZES_M - position) / towards[:, :2], axis=1)
            floor = np.where(towards[:, 2] < 0.0, -HEIGHT_M / towards[:, 2], np.inf)
        ranges = np.minimum(walls, floor).astype(np.float32)
        found.append(LaserScan(k * S // 10, "laser", ranges, -math.pi, step, 0.05, 30.0))
    return found


def lines_in(given: list[LaserScan], yaw_step_rad: float = 0.37) -> list[FloorLine]:
    """The lines, where the robot turns by `yaw_step_rad` from scan to scan."""
    yaws = yaw_step_rad * np.arange(len(given))
    poses = np.column_stack([0.0 * yaws, 0.0 * yaws, yaws])
    path = Trajectory(np.array([scan.stamp_ns for scan in given], np.int64), poses)
    return find_floor_lines(given, lambda: path)


def test_a_wall_beside_a_robot_that_drives_around_a_building_is_no_floor() -> None:
    quarter = math.pi / 2.0
    corner = np.linspace(0.0, quarter, 12)[1:-1]
    yaws = np.concatenate(
        [np.append(quarter * k + corner, np.full(500, quarter * (k + 1))) for k in range(5)]
    )
    found = []
    for k, yaw in enumerate(yaws.tolist()):
        along = math.floor(yaw / quarter + 0.5) * quarter
        left = np.sin(BEARINGS + yaw - along)
        with np.errstate(divide="ignore"):
            ranges = np.where(left < -0.5, -1.8 / left, 3.0 + 4.0 * math.fmod(0.618 * k, 1.0))
        step = 2.0 * math.pi / len(BEARINGS)
        scan = np.minimum(ranges, 12.0).astype(np.float32)
        found.append(LaserScan(k * S // 10, "laser", scan, -math.pi, step, 0.05, 30.0))
    stamps_ns = np.array([scan.stamp_ns for scan in found], np.int64)
    path = Trajectory(stamps_ns, np.column_stack([np.zeros((len(yaws), 2)), yaws]))
    assert find_floor_lines(found, lambda: path) == []


@pytest.mark.parametrize("bearing_deg", [0.0, 90.0, -140.0])
def test_the_line_of_the_floor_is_found_and_left_out(bearing_deg: float) -> None:
    tilt_rad, bearing = math.radians(10.0), math.radians(bearing_deg)
    given = scans(Rotation.from_rotvec(tilt_rad * np.array([-math.sin(bearing), math.cos(bearing), 0.0])))
    (line,) = lines_in(given)
    assert line.distance_m == pytest.approx(HEIGHT_M / math.sin(tilt_rad), rel=0.02)
    assert math.remainder(line.bearing_rad - bearing, math.tau) == pytest.approx(0.0, abs=0.03)
    ahead = int(np.argmin(np.abs(np.remainder(BEARINGS - bearing + np.pi, math.tau) - np.pi)))
    for scan in given:
        kept = line.removed_from(scan).ranges_m[ahead]
        assert math.isnan(kept) == (scan.ranges_m[ahead] > 0.8 * line.distance_m)
    assert "tilted against its extrinsics" in line.note


@pytest.mark.parametrize("tilt_deg", [0.0, 2.0])
def test_a_lidar_that_is_level_enough_meets_no_floor(tilt_deg: float) -> None:
    assert lines_in(scans(Rotation.from_euler("y", tilt_deg, degrees=True))) == []


def test_few_views_show_no_line() -> None:
    assert lines_in(scans(Rotation.from_euler("y", 10.0, degrees=True), count=20)) == []


@pytest.mark.parametrize("roll", [0.0, math.pi])
def test_the_height_of_the_lidar_gives_its_tilt(roll: float) -> None:
    stated, tilt = Rotation.from_euler("x", roll), Rotation.from_euler("y", 10.0, degrees=True)
    tilt = tilt.inv() if roll else tilt  # its x axis points down
    (line,) = lines_in(scans(tilt, base=stated))
    x, y, z, w = stated.as_quat().tolist()
    transform = Transform(0, "base_link", "laser", (0.0, 0.0, HEIGHT_M), (w, x, y, z), is_static=True)
    found = line.applied_to_transform(transform)
    w, x, y, z = found.quat_wxyz
    error = (stated * tilt).inv() * Rotation.from_quat([x, y, z, w])
    assert math.degrees(error.magnitude()) < 0.5
    assert extrinsics_of(found).projection.x_per_x == pytest.approx(math.cos(math.radians(10.0)), abs=0.002)
    unknown = Transform(0, "base_link", "laser", (0.0, 0.0, 0.0), transform.quat_wxyz, is_static=True)
    assert line.applied_to_transform(unknown) is unknown


def test_other_lidars_are_left_alone() -> None:
    (scan,) = scans(Rotation.identity(), count=1)
    other = FloorLine(beams_of(scan)[0]._replace(frame_id="other"), 1.0, 0.0)
    assert other.removed_from(scan) is scan
