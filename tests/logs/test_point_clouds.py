"""Point clouds: read in any layout, and made into scans."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gridslam.core.messages import LaserScan, Odometry, PointCloud, Transform
from gridslam.logs.codecs import cloud as codec
from gridslam.logs.config import CloudConfig, LogConfig
from gridslam.logs.convert import convert_log
from gridslam.logs.open import open_log
from gridslam.logs.placement.virtual_scan import BEAMS, virtual_lidar
from gridslam.logs.skips import UnusableMessageError
from gridslam.logs.write import write_log

S = 1_000_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)


def placed_sensors(z: float, quat: tuple[float, float, float, float] = LEVEL) -> Transform:
    return Transform(0, "base_link", "lidar", (0.1, 0.0, z), quat, is_static=True)


def cloud_of(points: object, times: object = ()) -> PointCloud:
    return PointCloud(5 * S, "lidar", np.array(points, np.float32), np.array(times, np.float32))


def room_cloud(stamp_ns: int = 5 * S) -> PointCloud:
    """Walls at 3 m all around from floor to ceiling, as a spinning lidar 1 m above the ground sees them."""
    bearing, height = np.meshgrid(
        np.linspace(-math.pi, math.pi, 720, endpoint=False), np.linspace(-1.0, 1.5, 16)
    )
    points = np.stack([3.0 * np.cos(bearing), 3.0 * np.sin(bearing), height], axis=-1).reshape(-1, 3)
    return PointCloud(stamp_ns, "lidar", points.astype(np.float32), np.zeros(0, np.float32))


def message(names: str, dtype: np.dtype, rows: np.ndarray, **changes: object) -> SimpleNamespace:
    """A decoded PointCloud2 of one row."""
    kinds = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
    fields = [
        SimpleNamespace(
            name=n, offset=dtype.fields[n][1], datatype=kinds[dtype.fields[n][0].str[1:]], count=1
        )
        for n in names.split()
    ]
    header = SimpleNamespace(stamp=SimpleNamespace(sec=5, nanosec=0), frame_id="lidar")
    data = np.frombuffer(rows.tobytes(), np.uint8)
    given = {
        "header": header, "height": 1, "width": len(rows), "fields": fields, "is_bigendian": False,
        "point_step": dtype.itemsize, "row_step": dtype.itemsize * len(rows), "data": data, "is_dense": True,
    }  # fmt: skip
    return SimpleNamespace(**{**given, **changes})


def test_the_nearest_return_of_each_bearing_is_kept() -> None:
    rng = np.random.default_rng(5)
    bearing, ranges = rng.uniform(-math.pi, math.pi, 5000), rng.integers(1, 60, 5000) * 0.5
    points = np.column_stack([ranges * np.cos(bearing), ranges * np.sin(bearing), np.zeros(5000)])
    found = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(cloud_of(points)).ranges_m
    beam = ((bearing + math.pi) * (BEAMS / (2.0 * math.pi))).astype(int) % BEAMS
    expected = [ranges[beam == k].min() if (beam == k).any() else math.nan for k in range(BEAMS)]
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_noise_does_not_draw_a_wall_nearer() -> None:
    # A depth camera sees a wall at 4 m in 60 rows of pixels; the noise of its depths is 0.0015 of their square.
    rng = np.random.default_rng(2)
    bearing, height = np.meshgrid(np.linspace(-0.5, 0.5, 150), np.linspace(-0.5, 0.5, 60))
    points = np.stack([np.ones_like(bearing), np.tan(bearing), height / 4.0], axis=-1)
    points *= rng.normal(4.0, 0.0015 * 4.0**2, bearing.shape)[..., None]
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(cloud_of(points.reshape(-1, 3)))
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(BEAMS)
    ahead_m = scan.ranges_m * np.cos(angles)
    assert np.count_nonzero(np.isfinite(ahead_m)) >= 140
    assert np.nanmean(ahead_m) == pytest.approx(4.0, abs=0.005)


def test_any_order_of_fields_padding_and_byte_order_gives_the_same_points() -> None:
    xyz = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [np.nan, 0.0, 0.0]])
    for order in "<>":
        dtype = np.dtype(
            {"names": ["ring", "z", "x", "y"], "formats": ["<u2", order + "f8", order + "f4", order + "f4"],
             "offsets": [0, 8, 20, 30], "itemsize": 48}
        )  # fmt: skip
        rows = np.zeros(3, dtype)
        for axis, name in enumerate("xyz"):
            rows[name] = xyz[:, axis]
        found = codec.from_ros(message("ring x y z", dtype, rows, is_bigendian=order == ">"), "/points")
        np.testing.assert_array_equal(found.points_m, xyz[:2])
        assert len(found.times_s) == 0


@pytest.mark.parametrize(
    ("name", "kind", "values"),
    [
        ("t", "<u4", [0, 50_000_000]),
        ("time", "<f4", [0.0, 0.05]),
        ("timestamp", "<f8", [5.0 + 1.7e9, 5.05 + 1.7e9]),
        ("timestamp", "<f8", [5.0e6 + 1.7e15, 5.05e6 + 1.7e15]),
        ("t", "<u4", [0, 50_000]),
        ("time", "<f4", [0.0, 50.0]),
        ("time", "<f4", [0.0, 5e7]),
    ],
)
def test_times_of_points_are_offsets_whatever_the_driver_writes(
    name: str, kind: str, values: list[float]
) -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), (name, kind)])
    rows = np.zeros(2, dtype)
    rows["x"], rows[name] = 1.0, values
    stamp = SimpleNamespace(sec=5 + (1_700_000_000 if name == "timestamp" else 0), nanosec=0)
    header = SimpleNamespace(stamp=stamp, frame_id="lidar")
    found = codec.from_ros(message(f"x y z {name}", dtype, rows, header=header), "/points")
    np.testing.assert_allclose(found.times_s, [0.0, 0.05], atol=1e-6)


def test_a_layout_that_contradicts_itself_is_refused() -> None:
    dtype = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    rows = np.zeros(4, dtype)
    with pytest.raises(UnusableMessageError, match="no_coordinates"):
        codec.from_ros(message("x y", dtype, rows), "/points")
    for changes in ({"width": 5}, {"point_step": 8}, {"height": 2}):
        with pytest.raises(ValueError):
            codec.from_ros(message("x y z", dtype, rows, **changes), "/points")
    with pytest.raises(UnusableMessageError, match="too_many_points"):
        codec.from_ros(message("x y z", dtype, rows, width=2**31, height=2**31), "/points")


def test_the_floor_and_the_ceiling_are_no_walls() -> None:
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(
        cloud_of([[2.0, 0.0, -1.0], [5.0, 0.0, 0.0], [1.0, 0.0, 1.5], [0.0, 3.0, 0.1], [0.0, 2.0, 0.2]])
    )
    seen = np.isfinite(scan.ranges_m)
    np.testing.assert_allclose(sorted(scan.ranges_m[seen]), [2.0, 5.0], rtol=1e-6)


def test_the_band_of_the_config_wins() -> None:
    config = CloudConfig(min_height_m=2.0, max_height_m=3.0)
    scan = virtual_lidar("lidar", placed_sensors(1.0), config).scan(
        cloud_of([[1.0, 0.0, 1.5], [5.0, 0.0, 0.0]])
    )
    np.testing.assert_allclose(scan.ranges_m[np.isfinite(scan.ranges_m)], [1.0], rtol=1e-6)


def test_a_tilted_lidar_gives_the_scan_of_a_level_one() -> None:
    half = math.radians(10.0)
    tilted = virtual_lidar(
        "lidar", placed_sensors(1.0, (math.cos(half), 0.0, math.sin(half), 0.0)), CloudConfig()
    )
    level = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig())
    cloud = room_cloud()
    turned = PointCloud(
        cloud.stamp_ns, "lidar", (cloud.points_m @ tilted.rotation).astype(np.float32), cloud.times_s
    )
    ours, theirs = tilted.scan(turned).ranges_m, level.scan(cloud).ranges_m
    assert np.isfinite(ours).sum() > 0.95 * np.isfinite(theirs).sum()
    np.testing.assert_allclose(ours[np.isfinite(ours)], 3.0, atol=1e-4)


@pytest.mark.parametrize("sense", [1, -1])
def test_the_times_of_a_spinning_lidar_become_the_sweep_of_the_scan(sense: int) -> None:
    place = np.arange(BEAMS)
    bearing = 0.7 + sense * place * 2.0 * math.pi / BEAMS
    points = np.stack([2.0 * np.cos(bearing), 2.0 * np.sin(bearing), np.zeros(BEAMS)], axis=1)
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(
        cloud_of(points, 0.1 * place / BEAMS)
    )
    assert scan.time_increment_s == pytest.approx(0.1 / BEAMS, rel=0.02)
    assert math.copysign(1, scan.angle_increment_rad) == sense
    assert scan.angle_min_rad == pytest.approx(0.7, abs=0.01)
    assert scan.stamp_ns == pytest.approx(5 * S, abs=2_000_000)


def test_times_that_do_not_follow_the_bearing_are_one_moment() -> None:
    rng = np.random.default_rng(1)
    cloud = room_cloud()
    times = rng.uniform(0.0, 0.1, len(cloud.points_m)).astype(np.float32)
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(
        PointCloud(cloud.stamp_ns, "lidar", cloud.points_m, times)
    )
    assert scan.time_increment_s == 0.0
    assert scan.stamp_ns == pytest.approx(5.05 * S, abs=0.02 * S)


def test_clouds_serve_as_scans_where_the_log_has_none_and_remain_clouds_in_a_conversion(
    tmp_path: Path,
) -> None:
    events = [placed_sensors(1.0), Odometry(5 * S, "odom", 0.0, 0.0, 0.0), room_cloud(), room_cloud(6 * S)]
    write_log(tmp_path / "log.mcap", events)
    with open_log(tmp_path / "log.mcap", LogConfig(), ("scan", "odom")) as log:
        found = list(log.events())
        assert any("serve as scans" in line for line in log.problems)
    scans = [event for event in found if isinstance(event, LaserScan)]
    assert [scan.stamp_ns for scan in scans] == [5 * S, 6 * S]
    frames = {event.child_frame_id: event for event in found if isinstance(event, Transform)}
    assert frames[scans[0].frame_id].translation_m == pytest.approx((0.1, 0.0, 1.0))
    with open_log(tmp_path / "log.mcap") as log:
        convert_log(log, tmp_path / "copy.mcap")
        conversion = convert_log(log, tmp_path / "folder")
    assert conversion.left_out == ["/points (sensor_msgs/msg/PointCloud2)"]
    with open_log(tmp_path / "copy.mcap") as log:
        clouds = [event for event in log.events() if isinstance(event, PointCloud)]
    np.testing.assert_array_equal(clouds[0].points_m, room_cloud().points_m)


def turning_cloud(bearings: np.ndarray, times: np.ndarray, yaw_rate: float) -> PointCloud:
    """Returns of a wall 3 m ahead at `times`, seen by a lidar that turns and faces the wall at 0.05 s."""
    world = bearings + yaw_rate * (times - 0.05)
    ranges = 3.0 / np.cos(world)
    return cloud_of(
        np.column_stack([ranges * np.cos(bearings), ranges * np.sin(bearings), 0.0 * ranges]), times
    )


def test_the_turn_of_the_robot_does_not_bring_a_wall_nearer_that_no_sweep_has_taken() -> None:
    rng = np.random.default_rng(3)
    bearings, times = rng.uniform(-1.0, 1.0, 8000), np.sort(rng.uniform(0.0, 0.1, 8000))
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(
        turning_cloud(bearings, times, 1.2)
    )
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(BEAMS)
    seen = np.isfinite(scan.ranges_m)
    assert np.abs(scan.ranges_m * np.cos(angles) - 3.0)[seen].mean() < 0.012  # of all 8,000 returns: 0.076
    assert abs(scan.stamp_ns - 5.05 * S) < 2_000_000
    assert (np.abs(angles[seen]).max() > 0.98) and seen.sum() > 250


def test_a_pattern_that_takes_all_the_time_for_its_field_of_view_keeps_it() -> None:
    times = np.linspace(0.0, 0.1, 4000)
    bearings = np.abs((times * 20.0) % 2.0 - 1.0) * 2.0 - 1.0  # there and back
    scan = virtual_lidar("lidar", placed_sensors(1.0), CloudConfig()).scan(
        turning_cloud(bearings, times, 0.0)
    )
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(BEAMS)
    seen = angles[np.isfinite(scan.ranges_m)]
    assert seen.min() < -0.85 and seen.max() > 0.85
