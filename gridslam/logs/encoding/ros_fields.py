"""Parts that many ROS messages share, read from decoded messages (any object with the message's fields)."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from gridslam.core.messages import Scalar, readonly
from gridslam.core.stamps import join_stamp
from gridslam.logs.rotations import heading_of
from gridslam.logs.skips import SkipReason, UnusableMessageError


def plain_name(value: object) -> str:
    """A name in a message, up to the first NUL, which no format can store; empty for null in JSON.

    Raises TypeError: it is neither a string nor an integer.
    """
    if isinstance(value, str):
        return value.partition("\0")[0]
    if value is None:
        return ""
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError(f"a name of type {type(value).__name__}")
    return str(value)


def frame_name(value: object) -> str:
    """A frame's name without the leading slash of old tf."""
    return plain_name(value).lstrip("/")


def vector(values: Any, dtype: type[Scalar]) -> NDArray[Scalar]:
    """A list of numbers `(n,)` of a message. Raises ValueError: it is something else, such as null or a list of lists in JSON."""
    found = readonly(values, dtype)
    if found.ndim != 1 or isinstance(values, str) or not hasattr(values, "__len__"):
        raise ValueError("expected a list of numbers")
    return found


def head(message: Any) -> tuple[int | None, str]:
    """(stamp_ns, frame) of a message with a header; the stamp is None if it is invalid."""
    header = message.header
    return join_stamp(int(header.stamp.sec), int(header.stamp.nanosec)), frame_name(header.frame_id)


def valid_head(message: Any) -> tuple[int, str]:
    """(stamp_ns, frame) of a message with a header. Raises UnusableMessageError: the stamp is invalid."""
    stamp, frame = head(message)
    if stamp is None:
        raise UnusableMessageError(SkipReason.BAD_STAMP)
    return stamp, frame


def yaw_of_orientation(orientation: Any) -> float:
    """Canonical yaw (rad) of a geometry_msgs/Quaternion; NaN if it is not a rotation, such as zeros that were never set."""
    return heading_of(
        (float(orientation.w), float(orientation.x), float(orientation.y), float(orientation.z))
    )
