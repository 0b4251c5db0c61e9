"""From events to rows of CSV files: the fields after the stamp, numbers as the shortest text that reads back."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from gridslam.core.errors import LogError
from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    DepthImage,
    Disparity,
    Image,
    Imu,
    LaserScan,
    Odometry,
    Range,
    TagInventory,
    Transform,
    WheelTicks,
)
from gridslam.logs.csv.images import write_floats, write_pixels

if TYPE_CHECKING:
    from gridslam.logs.csv.writer import CsvFolderWriter


_UNREADABLE = frozenset("\0\r\n")


def _number(value: float) -> str:
    """The shortest text that gives the same float64 again; empty for NaN."""
    return "" if math.isnan(value) else repr(float(value))


def _single(value: float) -> str:
    """The shortest text that gives the same float32 again."""
    return str(np.float32(value))


def _name(value: str) -> str:
    """A name as it is. LogError for one that would not read back: a line is a row, and fields are stripped."""
    if value.encode(errors="ignore").decode().strip() != value or not _UNREADABLE.isdisjoint(value):
        raise LogError(
            f"the name {value!r} cannot be written to a CSV file, where line breaks and blanks at the ends get lost; "
            "name the output OUT.mcap"
        )
    return value


def frame_field(frame: str) -> str:
    """A frame where each row of a stream names its own. LogError for one that would not read back."""
    if not frame:
        raise LogError(
            "messages with and without a frame in one stream cannot be written to a CSV file; "
            "name the output OUT.mcap"
        )
    return _name(frame)


def _scan(writer: CsvFolderWriter, scan: LaserScan) -> list[list[str]]:
    head = [
        scan.angle_min_rad,
        scan.angle_increment_rad,
        scan.range_min_m,
        scan.range_max_m,
        scan.time_increment_s,
    ]
    return [[_single(v) for v in head] + [str(r) for r in np.asarray(scan.ranges_m, np.float32)]]


def _odometry(writer: CsvFolderWriter, o: Odometry) -> list[list[str]]:
    return [[_number(v) for v in (o.x_m, o.y_m, o.yaw_rad, o.vx_mps, o.wz_radps)]]


def _truth(writer: CsvFolderWriter, o: Odometry) -> list[list[str]]:
    return [[_number(v) for v in (o.x_m, o.y_m, o.yaw_rad)]]


def _imu(writer: CsvFolderWriter, imu: Imu) -> list[list[str]]:
    return [[_number(imu.wz_radps)]]


def _wheels(writer: CsvFolderWriter, ticks: WheelTicks) -> list[list[str]]:
    return [[_number(ticks.left_rad), _number(ticks.right_rad)]]


def _range(writer: CsvFolderWriter, r: Range) -> list[list[str]]:
    limits = [_single(v) for v in (r.range_m, r.range_min_m, r.range_max_m)]
    return [[_name(r.frame_id), _number(r.bearing_rad), *limits]]


def _fix(writer: CsvFolderWriter, fix: AbsolutePose) -> list[list[str]]:
    c = fix.covariance
    values = [*fix.pose, c[0, 0], c[1, 1], c[2, 2], c[0, 1], c[0, 2], c[1, 2]]
    return [[_number(float(v)) for v in values]]


def _tags(writer: CsvFolderWriter, tags: TagInventory) -> list[list[str]]:
    antenna, frame = _name(tags.antenna), _name(tags.frame_id)
    if not tags.tag_ids:
        return [[antenna, "", "", frame]]
    if not all(tags.tag_ids):
        raise LogError(
            f"antenna {antenna!r} read a tag without an id, which a CSV file takes for an empty inventory; "
            "name the output OUT.mcap"
        )
    reads = zip(tags.tag_ids, tags.rssi_dbm, strict=True)
    return [[antenna, _name(tag), _single(rssi), frame] for tag, rssi in reads]


def _image(writer: CsvFolderWriter, image: Image) -> list[list[str]]:
    name = writer.picture("image", image, write_pixels, image.pixels, ".png")
    return [[_name(image.camera), name, _name(image.frame_id)]]


def _depth(writer: CsvFolderWriter, depth: DepthImage) -> list[list[str]]:
    name = writer.picture("depth", depth, write_floats, depth.depth_m, ".npy")
    return [[_name(depth.camera), name, _name(depth.frame_id)]]


def _disparity(writer: CsvFolderWriter, d: Disparity) -> list[list[str]]:
    name = writer.picture("disparity", d, write_floats, d.disparity_px, ".npy")
    return [[_name(d.camera), name, _single(d.focal_px), _single(d.baseline_m), _name(d.frame_id)]]


def _camera_info(writer: CsvFolderWriter, info: CameraInfo) -> list[list[str]]:
    numbers = [_number(float(v)) for v in (*np.ravel(info.K), *np.ravel(info.P))]
    distortion = [_number(float(v)) for v in info.D[:14]] + [""] * (14 - len(info.D))
    size = [str(info.width_px), str(info.height_px)]
    return [[_name(info.camera), *size, *numbers, *distortion, _name(info.frame_id)]]


def _transform(writer: CsvFolderWriter, t: Transform) -> list[list[str]]:
    edge = (_name(t.frame_id), _name(t.child_frame_id))
    return [[*edge, *(_number(v) for v in (*t.translation_m, *t.quat_wxyz))]]


ROWS: dict[str, Callable[[CsvFolderWriter, Any], list[list[str]]]] = {
    "scan": _scan,
    "odom": _odometry,
    "truth": _truth,
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
