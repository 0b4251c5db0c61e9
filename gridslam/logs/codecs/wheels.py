"""Codecs of wheel angles: sensor_msgs/JointState and CSV rows."""

from __future__ import annotations

import math

import numpy as np

from gridslam.core.messages import Range, WheelTicks
from gridslam.logs.encoding.cdr import CdrWriter
from gridslam.logs.encoding.csv_fields import number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.skips import SkipReason


def unusable_reason(ticks: WheelTicks) -> SkipReason | None:
    """The reason why no method can use the angles; None if it can."""
    is_finite = math.isfinite(ticks.left_rad) and math.isfinite(ticks.right_rad)
    return None if is_finite else SkipReason.NOT_FINITE


def joint_state(event: WheelTicks | Range, angles_rad: dict[str, float]) -> CdrWriter:
    """The body of a sensor_msgs/JointState with angles by joint, without speeds and efforts."""
    body = with_header(event).texts(list(angles_rad))
    body.sequence(np.array(list(angles_rad.values()), dtype=np.float64), 8)
    return body.uint32(0).uint32(0)


def to_ros(ticks: WheelTicks, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/JointState of the joints `left_wheel` and `right_wheel`."""
    body = joint_state(ticks, {"left_wheel": ticks.left_rad, "right_wheel": ticks.right_rad})
    return single_message(topic or "/joint_states", "sensor_msgs/msg/JointState", ticks, body)


def from_csv(rows: list[Row]) -> WheelTicks:
    """The angles in one row."""
    (row,) = rows
    return WheelTicks(row.stamp_ns, row.frame, row.number("left"), row.number("right"))


def to_csv(ticks: WheelTicks, pictures: PictureWriter) -> list[list[str]]:
    """One row: left and right angle."""
    return [[number_field(ticks.left_rad), number_field(ticks.right_rad)]]
