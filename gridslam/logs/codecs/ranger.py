"""Codecs of readings of single-beam rangers: sensor_msgs/Range with the servo's sensor_msgs/JointState, and CSV rows."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from gridslam.core.messages import Range, as_float32
from gridslam.logs.codecs.wheels import joint_state
from gridslam.logs.encoding.csv_fields import name_field, number_field, single_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.skips import SkipReason

_INFRARED = 1  # sensor_msgs/Range: radiation_type
_UNKNOWN_FIELD_OF_VIEW = 0.0


def unusable_reason(reading: Range) -> SkipReason | None:
    """The reason why no method can use the reading; None if it can."""
    if not math.isfinite(reading.bearing_rad):
        return SkipReason.NOT_FINITE
    has_limits = reading.range_max_m > max(reading.range_min_m, 0.0)
    return None if has_limits else SkipReason.BAD_RANGE_LIMITS


def from_ros(message: Any, bearing_of: Callable[[str], float]) -> Range:
    """The reading in a sensor_msgs/Range; `bearing_of(frame)` is the angle (rad) of the frame's servo."""
    stamp_ns, frame = valid_head(message)
    return Range(
        stamp_ns,
        frame,
        bearing_rad=bearing_of(frame),
        range_m=as_float32(message.range),
        range_min_m=as_float32(message.min_range),
        range_max_m=as_float32(message.max_range),
    )


def to_ros(reading: Range, topic: str | None) -> list[Encoded]:
    """Two messages: the servo's angle, as a joint with the ranger's name, then the reading."""
    topic = topic or "/range"
    servo = joint_state(reading, {reading.frame_id: reading.bearing_rad})
    body = with_header(reading).uint8(_INFRARED).float32(_UNKNOWN_FIELD_OF_VIEW)
    body.float32(reading.range_min_m, reading.range_max_m, reading.range_m)
    servos = single_message(f"{topic}/servo", "sensor_msgs/msg/JointState", reading, servo)
    return servos + single_message(topic, "sensor_msgs/msg/Range", reading, body)


def from_csv(rows: list[Row]) -> Range:
    """The reading in one row."""
    (row,) = rows
    value = row.number("range", math.nan)
    if row.is_marked_invalid("range"):
        value = math.nan
    return Range(
        row.stamp_ns,
        row.frame,
        bearing_rad=row.number("bearing"),
        range_m=as_float32(value),
        range_min_m=as_float32(row.number("range_min")),
        range_max_m=as_float32(row.number("range_max")),
    )


def to_csv(reading: Range, pictures: PictureWriter) -> list[list[str]]:
    """One row: sensor, bearing, range, and its limits."""
    limits = [single_field(v) for v in (reading.range_m, reading.range_min_m, reading.range_max_m)]
    return [[name_field(reading.frame_id), number_field(reading.bearing_rad), *limits]]
