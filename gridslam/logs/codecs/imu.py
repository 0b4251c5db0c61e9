"""Yaw rates: checks, sensor_msgs/Imu, rows of CSV."""

from __future__ import annotations

import math
from typing import Any

from gridslam.core.messages import Imu
from gridslam.logs.csv.fields import number_field
from gridslam.logs.csv.pictures import PictureWriter
from gridslam.logs.csv.row import Row
from gridslam.logs.ros.encoded import Encoded, single_message, with_header
from gridslam.logs.ros.fields import valid_head
from gridslam.logs.skips import SkipReason

_NOT_MEASURED = (-1.0, *(0.0,) * 8)  # sensor_msgs/Imu: a covariance that starts with -1 says "not measured"
_UNKNOWN_COVARIANCE = (0.0,) * 9


def unusable_reason(imu: Imu) -> SkipReason | None:
    """The reason why no method can use the reading; None where it can."""
    return None if math.isfinite(imu.wz_radps) else SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> Imu:
    """The yaw rate of a decoded sensor_msgs/Imu."""
    return Imu(*valid_head(message), wz_radps=float(message.angular_velocity.z))


def to_ros(imu: Imu, topic: str | None) -> list[Encoded]:
    """sensor_msgs/Imu with nothing but the yaw rate measured."""
    body = with_header(imu).float64(0.0, 0.0, 0.0, 1.0, *_NOT_MEASURED)
    body.float64(0.0, 0.0, imu.wz_radps, *_UNKNOWN_COVARIANCE)
    body.float64(0.0, 0.0, 0.0, *_NOT_MEASURED)
    return single_message(topic or "/imu", "sensor_msgs/msg/Imu", imu, body)


def from_csv(rows: list[Row]) -> Imu:
    """The yaw rate of one row."""
    (row,) = rows
    return Imu(row.stamp_ns, row.frame, row.number("wz"))


def to_csv(imu: Imu, pictures: PictureWriter) -> list[list[str]]:
    """One row."""
    return [[number_field(imu.wz_radps)]]
