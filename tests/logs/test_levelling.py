"""Scans levelled by the IMU: which IMUs are trusted, and what becomes of scans and clouds on a robot that tilts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gridslam.core.messages import Imu, LaserScan, PointCloud, Transform
from gridslam.logs import LogConfig, open_log
from gridslam.logs.config import CloudConfig
from gridslam.logs.imu.readings import ImuReadings, OdometryReference
from gridslam.logs.imu.tilt import UntrustedImuError, Verticals, verticals_of
from gridslam.logs.placement.levelling import LevelBand, Tilt, level_scan, without_floor
from gridslam.logs.placement.virtual_scan import virtual_lidar
from gridslam.logs.rotations import from_euler
from gridslam.logs.write import write_log
from gridslam.sensors.lidar_beams import beams_of, extrinsics_of

Floats = NDArray[np.float64]

S = 10**9
PERIOD_S = 0.02
SWAY_RAD = math.radians(6.0)
KINDS = ("scan", "imu")


def sway(times: Floats) -> Rotation:
    """The robot's attitude: it rolls, pitches and turns."""
    roll, pitch = SWAY_RAD * np.sin(2.0 * times), SWAY_RAD * np.sin(1.3 * times + 1.0)
    return Rotation.from_euler("ZYX", np.column_stack([0.5 * times, pitch, roll]))


TIMES = PERIOD_S * np.arange(2000)
ATTITUDE = sway(TIMES)
UP = ATTITUDE.inv().apply([0.0, 0.0, 1.0])
ODOMETRY = OdometryReference((TIMES * S).astype(np.int64), 0.5 * TIMES, np.zeros((len(TIMES), 2)))


def readings(attitude: Rotation = ATTITUDE, up: Floats = UP) -> ImuReadings:
    """What an ideal IMU measures, given its attitude and the vertical in its frame."""
    rates = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / PERIOD_S
    quats = attitude.as_quat()[:, [3, 0, 1, 2]]
    return ImuReadings((TIMES * S).astype(np.int64), quats, np.vstack([rates, rates[-1:]]), 9.81 * up)


def placed_sensors(rotation: Rotation, is_ned: bool = False) -> ImuReadings:
    """The IMU with another attitude on the robot; NED: the world's z axis points down as well."""
    attitude = ATTITUDE * rotation
    world = Rotation.from_rotvec([math.pi, 0.0, 0.0]) if is_ned else Rotation.identity()
    return readings(world * attitude, attitude.inv().apply([0.0, 0.0, 1.0]))


def without(**changes: float) -> ImuReadings:
    given = readings()
    return replace(given, **{name: np.full(getattr(given, name).shape, v) for name, v in changes.items()})


DOWN = Rotation.from_rotvec([math.pi, 0.0, 0.0])
NAN = float("nan")


def check(found: Verticals, tolerance_deg: float = 0.5) -> None:
    off = np.degrees(np.arccos(np.clip((found.up * UP).sum(axis=1), -1.0, 1.0)))
    assert off.max() < tolerance_deg


@pytest.mark.parametrize(
    ("given", "remark"),
    [
        (readings(), ""),
        (without(forces=NAN), ""),
        (replace(readings(), forces=UP), ""),  # in g
        (replace(readings(), rates=without(rates=0.0).rates), ""),
        (placed_sensors(DOWN, is_ned=True), "NED"),
        (replace(placed_sensors(DOWN, is_ned=True), forces=np.full((2000, 3), NAN)), "NED"),
        (replace(readings(), forces=-9.81 * UP), ""),  # gravity in place of the force against it
    ],
)
def test_the_vertical_is_found(given: ImuReadings, remark: str) -> None:
    found = verticals_of(given, np.eye(3), ODOMETRY)
    check(found)
    assert remark in "".join(found.remarks) and bool(remark) == bool(found.remarks)
    assert not found.by_gravity and not found.is_level


@pytest.mark.parametrize(
    ("given", "remark"),
    [
        (without(quats=NAN), ""),
        (replace(readings(), quats=np.tile([1.0, 0.0, 0.0, 0.0], (2000, 1))), ""),  # never set
        (replace(readings(), quats=2.0 * readings().quats), "length 2"),
        (replace(readings(), quats=readings().quats * [1.0, -1.0, -1.0, -1.0]), "turn rates"),
        (replace(readings(), quats=readings().quats[::-1]), "turn rates"),
    ],
)
def test_without_an_orientation_that_can_be_trusted_gravity_shows_the_vertical(
    given: ImuReadings, remark: str
) -> None:
    found = verticals_of(given, np.eye(3), ODOMETRY)
    check(found, 1.5)
    assert found.by_gravity and remark in "".join(found.remarks)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        (without(quats=NAN, forces=NAN), "^$"),  # a gyro
        (without(quats=NAN, forces=0.0), "^$"),
        (placed_sensors(Rotation.from_rotvec([0.0, math.radians(40.0), 0.0])), "tilted by 40 deg"),
        (placed_sensors(DOWN), "upside down"),
        (
            replace(without(forces=NAN, rates=0.0), quats=readings().quats[:, [1, 0, 3, 2]]),
            "upside down|tilt",
        ),
    ],
)
def test_an_imu_that_does_not_know_the_vertical_is_not_trusted(given: ImuReadings, reason: str) -> None:
    with pytest.raises(UntrustedImuError, match=reason):
        verticals_of(given, np.eye(3), ODOMETRY)


@pytest.mark.parametrize("rotation", [DOWN, Rotation.from_euler("ZYX", [1.0, 0.7, -0.4])])
def test_known_extrinsics_account_for_any_rotation_of_the_imu(rotation: Rotation) -> None:
    check(verticals_of(placed_sensors(rotation), rotation.as_matrix(), ODOMETRY))


def test_a_robot_that_remains_level_is_known_as_such() -> None:
    flat = Rotation.from_euler("ZYX", np.column_stack([0.5 * TIMES, np.zeros(2000), 0.002 * np.sin(TIMES)]))
    assert verticals_of(readings(flat, flat.inv().apply([0.0, 0.0, 1.0])), np.eye(3), ODOMETRY).is_level


def log_with(path: Path, imu: Callable[[int, Rotation], Imu], height_m: float = 0.6) -> Path:
    """A lidar in the middle of a round room of 6 m radius, with the floor `height_m` below it."""
    bearings = np.linspace(-math.pi, math.pi, 180, endpoint=False)
    rays = np.column_stack([np.cos(bearings), np.sin(bearings), np.zeros(180)])
    events: list[object] = [
        Transform(0, "base_link", "laser", (0.0, 0.0, height_m), (1.0, 0.0, 0.0, 0.0), is_static=True)
    ]
    for k, time_s in enumerate(TIMES[:500]):
        stamp_ns = S + round(time_s * S)
        events.append(imu(stamp_ns, ATTITUDE[k]))
        if k % 5:
            continue
        position = ATTITUDE[k].apply([0.0, 0.0, height_m])
        towards = ATTITUDE[k].apply(rays)
        along = towards[:, :2] @ position[:2]
        flat = (towards[:, :2] ** 2).sum(axis=1)
        wall = (-along + np.sqrt(along**2 - flat * (position[:2] @ position[:2] - 36.0))) / flat
        with np.errstate(divide="ignore"):
            floor = np.where(towards[:, 2] < 0.0, -position[2] / towards[:, 2], np.inf)
        ranges = np.minimum(wall, floor).astype(np.float32)
        step = 2.0 * math.pi / 180
        events.append(
            LaserScan(stamp_ns, "laser", ranges, np.float32(-math.pi), np.float32(step), 0.05, 30.0)
        )
    write_log(path, events)
    return path


def full_imu(stamp_ns: int, attitude: Rotation, frame: str = "base_link") -> Imu:
    x, y, z, w = attitude.as_quat().tolist()
    force = (9.81 * attitude.inv().apply([0.0, 0.0, 1.0])).tolist()
    return Imu(stamp_ns, frame, 0.5, quat_wxyz=(w, x, y, z), accel_mps2=tuple(force))


def test_levelled_beams_end_on_the_walls_and_not_on_the_floor(tmp_path: Path) -> None:
    placed = {}
    with open_log(log_with(tmp_path / "a.mcap", full_imu, height_m=0.4), kinds=KINDS) as log:
        assert any("levelled by its orientation" in line for line in log.problems)
        for event in log.events():
            if isinstance(event, Transform):
                placed[event.child_frame_id] = extrinsics_of(event)
            elif isinstance(event, LaserScan):
                found = beams_of(event, placed[event.frame_id], 0.1, 30.0)
                assert 60 < len(found.points) <= 180
                assert np.abs(np.hypot(*found.points.T) - 6.0).max() < 0.02


@pytest.mark.parametrize(
    ("imu", "line"),
    [
        (lambda s, a: Imu(s, "base_link", 0.5), None),
        (lambda s, a: Imu(s, "base_link", 0.5, quat_wxyz=(1.0, 0.0, 0.0, 0.0)), None),
        (lambda s, a: full_imu(s, a * DOWN), "upside down"),
        (lambda s, a: full_imu(s, Rotation.from_rotvec(0.001 * a.as_rotvec())), None),
    ],
)
def test_scans_are_unchanged_where_no_tilt_is_known(
    tmp_path: Path, imu: Callable[[int, Rotation], Imu], line: str | None
) -> None:
    path = log_with(tmp_path / "a.mcap", imu)
    with open_log(path, kinds=("scan",), config=LogConfig(topics={"imu": []})) as log:
        expected = [e for e in log.events() if isinstance(e, LaserScan)]
    with open_log(path, kinds=KINDS) as log:
        found = [e for e in log.events() if isinstance(e, LaserScan)]
        assert any("level" in problem for problem in log.problems) == (line is not None)
        assert line is None or any(line in problem for problem in log.problems)
    assert [e.frame_id for e in found] == ["laser"] * len(expected)
    for one, other in zip(found, expected, strict=True):
        assert one.ranges_m.tobytes() == other.ranges_m.tobytes()


@pytest.mark.parametrize(("last_s", "shift_s", "line"), [(5.0, 0.0, "cover 5"), (99.0, 500.0, "cover 0%")])
def test_an_imu_that_covers_a_part_of_the_scans_says_so(
    tmp_path: Path, last_s: float, shift_s: float, line: str
) -> None:
    def imu(stamp_ns: int, attitude: Rotation) -> Imu:
        made = full_imu(stamp_ns, attitude)
        is_early = stamp_ns < (1.0 + last_s) * S
        return replace(made, stamp_ns=stamp_ns + round(shift_s * S)) if is_early else Imu(0, "a", 0.0)

    with open_log(log_with(tmp_path / "a.mcap", imu), kinds=KINDS) as log:
        assert any(line in problem and "not levelled" in problem for problem in log.problems)
        scans = [e for e in log.events() if isinstance(e, LaserScan)]
    assert {e.frame_id for e in scans} == {"laser"} or shift_s == 0.0


def test_an_imu_without_extrinsics_is_taken_as_the_base_aloud(tmp_path: Path) -> None:
    path = log_with(tmp_path / "a.mcap", lambda s, a: full_imu(s, a, "imu_link"))
    with open_log(path, kinds=KINDS) as log:
        assert any("log.extrinsics.imu_link" in line for line in log.problems)


def test_beams_that_end_outside_the_band_are_left_out() -> None:
    ranges = np.array([5.0, 5.0, np.inf, 12.0], np.float32)
    scan = LaserScan(0, "laser", ranges, 0.0, 0.0, 0.1, 30.0)
    pitched = ((0.0, 0.0, 0.6), from_euler(0.0, math.radians(4.0), 0.0))
    found = level_scan(scan, pitched, LevelBand.of_lidar(0.6)).ranges_m
    np.testing.assert_array_equal(found, [5.0, 5.0, np.inf, np.nan])


def test_a_lidar_tilted_on_the_robot_does_not_see_the_floor() -> None:
    # Pitched by 10 degrees, 0.6 m high: the floor is 3.46 m ahead; behind, the beam rises to 1.8 m at 6.91 m.
    ranges = np.array([2.2, 3.46, 6.8, 7.0, np.inf], np.float32)
    angles = {"angle_min_rad": 0.0, "angle_increment_rad": 0.0}
    ahead = LaserScan(0, "laser", ranges, range_min_m=0.1, range_max_m=30.0, **angles)
    pitched = from_euler(0.0, math.radians(10.0), 0.0)
    found = without_floor(ahead, ((0.0, 0.0, 0.6), pitched)).ranges_m
    np.testing.assert_array_equal(found, [ranges[0], np.nan, np.nan, np.nan, np.inf])
    behind = without_floor(replace(ahead, angle_min_rad=math.pi), ((0.0, 0.0, 0.6), pitched)).ranges_m
    np.testing.assert_array_equal(behind, [*ranges[:3], np.nan, np.inf])
    assert without_floor(ahead, ((0.0, 0.0, 0.0), pitched)) is ahead
    assert without_floor(ahead, ((0.0, 0.0, 0.6), from_euler(0.0, 0.01, 0.0))) is ahead


@pytest.mark.parametrize("stamp_ns", [-10 * S, 3 * S, 10 * S])
def test_far_from_the_readings_no_tilt_is_known(stamp_ns: int) -> None:
    tilt = Tilt(np.array([0, S // 10, 6 * S]), np.tile([0.1, 0.0, 0.995], (3, 1)))
    assert tilt.at(stamp_ns) == (1.0, 0.0, 0.0, 0.0)
    assert tilt.at(S // 20) != (1.0, 0.0, 0.0, 0.0)


def test_a_cloud_of_a_tilted_robot_gives_the_scan_of_a_level_one() -> None:
    sensor_extrinsics = Transform(
        0, "base_link", "lidar", (0.1, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0), is_static=True
    )
    turned = Rotation.from_euler("ZYX", [0.0, 0.1, -0.05])
    up = turned.inv().apply([[0.0, 0.0, 1.0]] * 2)
    tilt = Tilt(np.array([0, 10 * S]), up)
    bearing, height = np.meshgrid(np.linspace(-3.1, 3.1, 700), np.linspace(-1.0, 1.0, 16))
    points = np.stack([3.0 * np.cos(bearing), 3.0 * np.sin(bearing), height], axis=-1).reshape(-1, 3)
    times = np.zeros(0, np.float32)
    level = virtual_lidar("lidar", sensor_extrinsics, CloudConfig()).scan(
        PointCloud(0, "lidar", points.astype(np.float32), times)
    )
    seen = PointCloud(0, "lidar", turned.inv().apply(points).astype(np.float32), times)
    tilted = virtual_lidar("lidar", sensor_extrinsics, CloudConfig(), tilt).scan(seen)
    np.testing.assert_allclose(tilted.ranges_m, level.ranges_m, rtol=1e-4)
