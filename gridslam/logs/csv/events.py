"""From rows of CSV files to events, one builder per kind. They raise ValueError for what is no such row."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Event,
    Image,
    Imu,
    LaserScan,
    Odometry,
    Range,
    TagInventory,
    Transform,
    WheelTicks,
    as_float32,
    canonical_yaw,
    readonly,
)
from gridslam.logs.csv.images import read_floats, read_pixels

if TYPE_CHECKING:
    from gridslam.logs.csv.table import CsvTable, Row

# Messages of the ValueErrors about picture files, which are the counted reasons too.
FILE_FAULTS = frozenset({"file_outside_folder", "missing_file", "unreadable_image"})


def _scan(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    fields = row.ranges()
    try:
        values = np.array(list(map(float, fields)))
    except ValueError:
        values = np.array([float(f) if f.strip() else math.nan for f in fields])
    ranges = table.to_metres(table.mark_invalid(values))
    return LaserScan(
        row.stamp_ns,
        table.frame_of(row),
        readonly(ranges, np.float32),
        as_float32(row.number("angle_min")),
        as_float32(row.number("angle_increment")),
        as_float32(row.number("range_min")),
        as_float32(row.number("range_max")),
        as_float32(row.number("time_increment", 0.0)),
    )


def _odometry(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    return Odometry(
        row.stamp_ns,
        table.frame_of(row),
        row.number("x"),
        row.number("y"),
        _yaw(row),
        row.number("vx", math.nan),
        row.number("wz", math.nan),
        row.text("child_frame", table.stream.child_frame or "base_link"),
    )


def _yaw(row: Row) -> float:
    """Canonical and in (-pi, pi]."""
    yaw = row.number("yaw")
    if abs(yaw) > math.pi and math.isfinite(yaw):
        yaw = math.remainder(yaw, 2.0 * math.pi)
    return canonical_yaw(yaw)


def _imu(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    return Imu(row.stamp_ns, table.frame_of(row), row.number("wz"))


def _wheels(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    return WheelTicks(row.stamp_ns, table.frame_of(row), row.number("left"), row.number("right"))


def _range(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    value = row.number("range", math.nan)
    if table.stream.invalid or table.stream.invalid_from is not None:
        place = table.places.get("range")
        raw = float(row.text("range") or "nan") if place is not None else math.nan
        value = math.nan if math.isnan(float(table.mark_invalid(np.array([raw]))[0])) else value
    return Range(
        row.stamp_ns,
        table.frame_of(row),
        row.number("bearing"),
        as_float32(value),
        as_float32(row.number("range_min")),
        as_float32(row.number("range_max")),
    )


def _fix(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    pose = np.array([row.number("x"), row.number("y"), _yaw(row)])
    xy, xt, yt = (row.number(name, 0.0) for name in ("cov_xy", "cov_xyaw", "cov_yyaw"))
    covariance = np.array(
        [[row.number("var_x"), xy, xt], [xy, row.number("var_y"), yt], [xt, yt, row.number("var_yaw")]]
    )
    return AbsolutePose(
        row.stamp_ns,
        table.frame_of(row),
        readonly(pose, np.float64),
        readonly(covariance, np.float64),
    )


def _tags(table: CsvTable, rows: list[Row]) -> Event:
    read = [row for row in rows if row.text("tag_id")]
    return TagInventory(
        rows[0].stamp_ns,
        table.frame_of(rows[0]),
        rows[0].text("antenna"),
        tuple(row.text("tag_id") for row in read),
        tuple(as_float32(row.number("rssi", math.nan)) for row in read),
    )


def _image(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    pixels = read_pixels(table.folder_file(row.text("file")))
    return Image(row.stamp_ns, table.frame_of(row), readonly(pixels, np.uint8), row.text("camera"))


def _depth(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    depth = read_floats(table.folder_file(row.text("file")))
    return DepthImage(row.stamp_ns, table.frame_of(row), readonly(depth, np.float32), row.text("camera"))


def _disparity(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    return Disparity(
        row.stamp_ns,
        table.frame_of(row),
        readonly(read_floats(table.folder_file(row.text("file"))), np.float32),
        as_float32(row.number("focal")),
        as_float32(row.number("baseline")),
        row.text("camera"),
    )


def _camera_info(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    distortion = [row.number(f"d{i}", math.nan) for i in range(14)]
    while distortion and math.isnan(distortion[-1]):
        distortion.pop()
    return CameraInfo(
        row.stamp_ns,
        table.frame_of(row),
        int(row.number("width")),
        int(row.number("height")),
        readonly(np.array([row.number(f"k{i}") for i in range(9)]).reshape(3, 3), np.float64),
        readonly(np.array([row.number(f"p{i}") for i in range(12)]).reshape(3, 4), np.float64),
        readonly(np.array(distortion), np.float64),
        row.text("camera"),
    )


def _transform(table: CsvTable, rows: list[Row]) -> Event:
    (row,) = rows
    return Transform(
        row.stamp_ns,
        row.text("parent"),
        row.text("child"),
        (row.number("x"), row.number("y"), row.number("z")),
        (row.number("qw"), row.number("qx"), row.number("qy"), row.number("qz")),
    )


BUILDERS: dict[str, Callable[[CsvTable, list[Row]], Event]] = {
    "scan": _scan,
    "odom": _odometry,
    "truth": _odometry,
    "imu": _imu,
    "wheels": _wheels,
    "range": _range,
    "fix": _fix,
    "tags": _tags,
    "image": _image,
    "depth": _depth,
    "disparity": _disparity,
    "camera_info": _camera_info,
    "tf": _transform,
}
