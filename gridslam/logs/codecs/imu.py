"""Codecs of IMU readings: sensor_msgs/Imu and CSV rows."""

from __future__ import annotations

import math
from typing import Any, TypeVar

from gridslam.core.messages import Imu
from gridslam.logs.encoding.csv_fields import number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.skips import SkipReason

_NOT_MEASURED = (-1.0, *(0.0,) * 8)  # sensor_msgs/Imu: a covariance that starts with -1 says "not measured"
_UNKNOWN_COVARIANCE = (0.0,) * 9
_QUATERNION, _ACCELERATION = ("qw", "qx", "qy", "qz"), ("ax", "ay", "az")
_ABSENT = math.nan
Values = TypeVar("Values", tuple[float, float, float], tuple[float, float, float, float])


def measured(values: Values, covariance: float = 0.0) -> Values | None:
    """The values; None if they were not measured: their covariance starts with -1, or they are all zero or not finite."""
    return values if covariance != -1.0 and any(values) and all(map(math.isfinite, values)) else None


def rate_or_zero(value: float) -> float:
    """The turn rate (rad/s), 0 if it is not a number."""
    return value if math.isfinite(value) else 0.0


def unusable_reason(imu: Imu) -> SkipReason | None:
    """The reason why no method can use the reading; None if it can."""
    return None if math.isfinite(imu.wz_radps) else SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> Imu:
    """The reading in a sensor_msgs/Imu."""
    rate, quat = message.angular_velocity, message.orientation
    force = message.linear_acceleration
    return Imu(
        *valid_head(message),
        wz_radps=float(rate.z),
        wx_radps=rate_or_zero(float(rate.x)),
        wy_radps=rate_or_zero(float(rate.y)),
        quat_wxyz=measured(
            (float(quat.w), float(quat.x), float(quat.y), float(quat.z)),
            float(message.orientation_covariance[0]),
        ),
        accel_mps2=measured(
            (float(force.x), float(force.y), float(force.z)), float(message.linear_acceleration_covariance[0])
        ),
    )


def to_ros(imu: Imu, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/Imu; the covariance of values that were not measured starts with -1."""
    w, x, y, z = imu.quat_wxyz or (1.0, 0.0, 0.0, 0.0)
    body = with_header(imu).float64(x, y, z, w, *_covariance(imu.quat_wxyz))
    body.float64(imu.wx_radps, imu.wy_radps, imu.wz_radps, *_UNKNOWN_COVARIANCE)
    body.float64(*(imu.accel_mps2 or (0.0, 0.0, 0.0)), *_covariance(imu.accel_mps2))
    return single_message(topic or "/imu", "sensor_msgs/msg/Imu", imu, body)


def from_csv(rows: list[Row]) -> Imu:
    """The reading in one row."""
    (row,) = rows
    w, x, y, z = (row.number(name, _ABSENT) for name in _QUATERNION)
    ax, ay, az = (row.number(name, _ABSENT) for name in _ACCELERATION)
    return Imu(
        row.stamp_ns,
        row.frame,
        row.number("wz"),
        wx_radps=rate_or_zero(row.number("wx", 0.0)),
        wy_radps=rate_or_zero(row.number("wy", 0.0)),
        quat_wxyz=measured((w, x, y, z)),
        accel_mps2=measured((ax, ay, az)),
    )


def to_csv(imu: Imu, pictures: PictureWriter) -> list[list[str]]:
    """One row: turn rates wz, wx, wy, quaternion w, x, y, z, and acceleration."""
    rates = (imu.wz_radps, imu.wx_radps, imu.wy_radps)
    quat, force = imu.quat_wxyz or (_ABSENT,) * 4, imu.accel_mps2 or (_ABSENT,) * 3
    return [[number_field(value) for value in (*rates, *quat, *force)]]


def _covariance(values: tuple[float, ...] | None) -> tuple[float, ...]:
    return _NOT_MEASURED if values is None else _UNKNOWN_COVARIANCE
