"""Parts that many of Foxglove's JSON messages share."""

from __future__ import annotations

import base64
import binascii
from typing import Any

from gridslam.core.stamps import join_stamp


def stamp_ns_of(stamp: Any) -> int | None:
    """Nanoseconds of a JSON time in ROS's or Foxglove's field names; None if it is not a valid stamp."""
    seconds = getattr(stamp, "sec", getattr(stamp, "secs", None))
    nanoseconds = getattr(stamp, "nsec", getattr(stamp, "nanosec", getattr(stamp, "nsecs", 0)))
    if not isinstance(seconds, int) or not isinstance(nanoseconds, int):
        return None
    return join_stamp(seconds, nanoseconds)


def base64_bytes(data: str) -> bytes:
    """The bytes of a JSON string. Raises ValueError: it is not base64."""
    try:
        return base64.b64decode(data, validate=True)
    except binascii.Error as error:
        raise ValueError("data is not base64") from error
