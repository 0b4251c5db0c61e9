"""Codecs of laser scans: sensor_msgs/LaserScan and MultiEchoLaserScan, foxglove.LaserScan, and CSV rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from gridslam.core.messages import LaserScan, as_float32, readonly
from gridslam.logs.encoding.csv_fields import single_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head, vector
from gridslam.logs.skips import SkipReason

# Largest angle of a sweep: some lidars overlap their own sweep a little; none goes round twice
_WIDEST_SWEEP_RAD = 2.0 * math.pi * 1.05


def unusable_reason(scan: LaserScan) -> SkipReason | None:
    """The reason why no method can use the scan; None if it can."""
    beams = len(scan.ranges_m)
    if beams == 0:
        return SkipReason.NO_BEAMS
    increment = scan.angle_increment_rad
    if not (math.isfinite(increment) and math.isfinite(scan.angle_min_rad)):
        return SkipReason.BAD_ANGLES
    if beams > 1 and (increment == 0.0 or abs(increment) * (beams - 1) > _WIDEST_SWEEP_RAD):
        return SkipReason.BAD_ANGLES
    if not scan.range_max_m > max(scan.range_min_m, 0.0):  # NaN fails too
        return SkipReason.BAD_RANGE_LIMITS
    return None


def from_ros(message: Any, topic: str) -> LaserScan:
    """The scan in a sensor_msgs/LaserScan."""
    return _scan(message, message.ranges)


def from_multi_echo(message: Any, topic: str) -> LaserScan:
    """The scan in a sensor_msgs/MultiEchoLaserScan: the strongest echo of each beam or, without intensities, the first."""
    intensities = message.intensities
    has_intensities = len(intensities) == len(message.ranges)
    ranges = [
        _strongest(beam.echoes, intensities[i].echoes if has_intensities else ())
        for i, beam in enumerate(message.ranges)
    ]
    return _scan(message, ranges)


def _strongest(ranges: Sequence[float], intensities: Sequence[float]) -> float:
    """Range (m) of the strongest echo (of equal ones, the first); infinite if there is none."""
    if not len(ranges):
        return math.inf
    return float(ranges[int(np.argmax(intensities))] if len(intensities) == len(ranges) else ranges[0])


def _scan(message: Any, ranges: Any) -> LaserScan:
    """A scan with the angles and limits of a message and the given ranges (m)."""
    return LaserScan(
        *valid_head(message),
        vector(ranges, np.float32),
        angle_min_rad=as_float32(message.angle_min),
        angle_increment_rad=as_float32(message.angle_increment),
        range_min_m=as_float32(message.range_min),
        range_max_m=as_float32(message.range_max),
        time_increment_s=as_float32(message.time_increment),
        angle_max_rad=as_float32(message.angle_max),
    )


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> LaserScan:
    """The scan in a foxglove.LaserScan, which states the angles of the first and the last beam, and no range limits."""
    ranges = np.array([np.nan if r is None else r for r in message.ranges], dtype=np.float64)
    span = float(message.end_angle) - float(message.start_angle)
    return LaserScan(
        stamp_ns,
        frame,
        vector(ranges, np.float32),
        angle_min_rad=as_float32(message.start_angle),
        angle_increment_rad=as_float32(span / max(len(ranges) - 1, 1)),
        range_min_m=0.0,
        range_max_m=float("inf"),
    )


def to_ros(scan: LaserScan, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/LaserScan."""
    last = scan.angle_max_rad
    if math.isnan(last):
        last = as_float32(scan.angle_min_rad + (len(scan.ranges_m) - 1) * scan.angle_increment_rad)
    scan_time = 0.0
    body = with_header(scan).float32(scan.angle_min_rad, last, scan.angle_increment_rad)
    body.float32(scan.time_increment_s, scan_time, scan.range_min_m, scan.range_max_m)
    body.sequence(scan.ranges_m, 4).uint32(0)
    return single_message(topic or "/scan", "sensor_msgs/msg/LaserScan", scan, body)


def from_csv(rows: list[Row]) -> LaserScan:
    """The scan in one row."""
    (row,) = rows
    return LaserScan(
        row.stamp_ns,
        row.frame,
        readonly(row.ranges_m(), np.float32),
        angle_min_rad=as_float32(row.number("angle_min")),
        angle_increment_rad=as_float32(row.number("angle_increment")),
        range_min_m=as_float32(row.number("range_min")),
        range_max_m=as_float32(row.number("range_max")),
        time_increment_s=as_float32(row.number("time_increment", 0.0)),
    )


def to_csv(scan: LaserScan, pictures: PictureWriter) -> list[list[str]]:
    """One row: the columns of the table, then the ranges."""
    limits = [scan.angle_min_rad, scan.angle_increment_rad, scan.range_min_m, scan.range_max_m]
    columns = [single_field(v) for v in (*limits, scan.time_increment_s)]
    return [columns + [str(r) for r in np.asarray(scan.ranges_m, np.float32)]]
