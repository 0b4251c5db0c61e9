"""Foxglove's JSON messages, and ROS messages written as JSON.

Definitions: https://docs.foxglove.dev/docs/visualization/message-schemas
"""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

from gridslam.core.messages import Event, Transform
from gridslam.logs.codecs.transform import INVALID_STAMP_NS
from gridslam.logs.encoding.foxglove_fields import stamp_ns_of
from gridslam.logs.encoding.ros_fields import frame_name
from gridslam.logs.message_kind import FromFoxglove
from gridslam.logs.skips import SkipReason, UnusableMessageError

_PART_STARTS = b",", b"[", b"{"  # each starts a part of a document
_MAX_PARTS = 1_000_000  # largest number in one message; each may take a hundred bytes, and more time than reading a number


def parse(data: bytes) -> Any:
    """The JSON document as an object with fields. Raises ValueError: it is not JSON, or has too many parts."""
    if sum(map(data.count, _PART_STARTS)) > _MAX_PARTS:
        raise ValueError(f"more than {_MAX_PARTS} values in a message")
    message = json.loads(data, object_hook=_object)
    if not isinstance(message, SimpleNamespace):
        raise ValueError("not a JSON object")
    return message


def head(message: Any) -> tuple[int | None, str]:
    """(stamp_ns, frame)."""
    if hasattr(message, "header"):
        stamp, frame = message.header.stamp, frame_name(message.header.frame_id)
    else:
        stamp, frame = message.timestamp, frame_name(getattr(message, "frame_id", ""))
    return stamp_ns_of(stamp), frame


def transforms(message: Any, is_static: bool) -> list[Transform]:
    """foxglove.FrameTransform(s), or a tf2_msgs/TFMessage in JSON."""
    found = []
    for item in getattr(message, "transforms", [message]):
        if hasattr(item, "transform"):
            stamp, parent = head(item)
            child, t, r = item.child_frame_id, item.transform.translation, item.transform.rotation
        else:
            stamp, parent = stamp_ns_of(item.timestamp), frame_name(item.parent_frame_id)
            child, t, r = item.child_frame_id, item.translation, item.rotation
        found.append(
            Transform(
                INVALID_STAMP_NS if stamp is None else stamp,
                parent,
                frame_name(child),
                translation_m=(float(t.x), float(t.y), float(t.z)),
                quat_wxyz=(float(r.w), float(r.x), float(r.y), float(r.z)),
                is_static=is_static,
            )
        )
    return found


def event(converter: FromFoxglove | None, message: Any, topic: str) -> Event:
    """The event of any Foxglove message but transforms."""
    stamp, frame = head(message)
    if stamp is None:
        raise UnusableMessageError(SkipReason.BAD_STAMP)
    if converter is None:
        raise ValueError("no conversion")
    return converter(stamp, frame, message, topic)


def _object(fields: dict[str, Any]) -> SimpleNamespace:
    """The fields as attributes. Raises ValueError (UnicodeEncodeError): a string is not valid Unicode."""
    for value in fields.values():
        if isinstance(value, str) and not value.isascii():
            value.encode()
        elif isinstance(value, list) and value and isinstance(value[0], str):
            "".join(map(str, value)).encode()
    return SimpleNamespace(**fields)
