"""Parts that many ROS messages share, read from decoded messages (any object with the message's fields)."""

from __future__ import annotations

from typing import Any

from gridslam.core.stamps import join_stamp
from gridslam.logs.rotations import heading_of
from gridslam.logs.skips import SkipReason, UnusableMessageError


def plain_name(value: object) -> str:
    """A name of a message: a zero ends it, as in C, and no format can hold one."""
    return str(value).partition("\0")[0]


def frame_name(value: object) -> str:
    """A frame's name without the leading slash of old tf."""
    return plain_name(value).lstrip("/")


def head(message: Any) -> tuple[int | None, str]:
    """(stamp_ns, frame) of a message with a header; the stamp is None where it is invalid."""
    header = message.header
    return join_stamp(int(header.stamp.sec), int(header.stamp.nanosec)), frame_name(header.frame_id)


def valid_head(message: Any) -> tuple[int, str]:
    """(stamp_ns, frame) of a message with a header. Raises UnusableMessageError: the stamp is invalid."""
    stamp, frame = head(message)
    if stamp is None:
        raise UnusableMessageError(SkipReason.BAD_STAMP)
    return stamp, frame


def yaw_of_orientation(orientation: Any) -> float:
    """Canonical yaw (rad) of a geometry_msgs/Quaternion; NaN where it is no rotation, as zeros that were never set."""
    return heading_of(
        (float(orientation.w), float(orientation.x), float(orientation.y), float(orientation.z))
    )
