"""Foxglove's JSON messages, and ROS messages written as JSON.

Definitions: https://docs.foxglove.dev/docs/visualization/message-schemas
"""

from __future__ import annotations

import base64
import binascii
import json
from types import SimpleNamespace
from typing import Any

import numpy as np

from gridslam.core.messages import (
    CameraInfo,
    DepthImage,
    Event,
    Image,
    LaserScan,
    Odometry,
    Transform,
    as_float32,
    canonical_yaw,
    readonly,
)
from gridslam.logs.cameras import DEPTH_ENCODINGS, camera_of, depth_of, pixels_of, unpack_picture
from gridslam.logs.rotations import yaw_of
from gridslam.logs.stamps import join_stamp

_KINDS = {
    "foxglove.LaserScan": "scan",
    "foxglove.PoseInFrame": "pose",
    "foxglove.FrameTransform": "tf",
    "foxglove.FrameTransforms": "tf",
    "foxglove.RawImage": "image",
    "foxglove.CompressedImage": "image",
    "foxglove.CameraCalibration": "camera_info",
}


def kind_of(type_name: str) -> str:
    """The stream that a Foxglove type serves; empty for other types."""
    return _KINDS.get(type_name, "")


def parse(data: bytes) -> Any:
    """The JSON document as an object with fields. Raises ValueError where it is none."""
    message = json.loads(data, object_hook=lambda fields: SimpleNamespace(**fields))
    if not isinstance(message, SimpleNamespace):
        raise ValueError("not a JSON object")
    return message


def kind_of_message(type_name: str, kind: str, message: Any) -> str:
    """A pose in an odometry frame is odometry; a raw image may hold depths."""
    if type_name == "foxglove.PoseInFrame" and "odom" in str(message.frame_id):
        return "odom"
    if kind == "image" and getattr(message, "encoding", "") in DEPTH_ENCODINGS:
        return "depth"
    return kind


def head(message: Any) -> tuple[int | None, str]:
    """(stamp_ns, frame)."""
    if hasattr(message, "header"):
        stamp, frame = message.header.stamp, str(message.header.frame_id)
    else:
        stamp, frame = message.timestamp, str(getattr(message, "frame_id", ""))
    return _stamp(stamp), frame.lstrip("/")


def transforms(message: Any, static: bool) -> list[Transform]:
    """foxglove.FrameTransform(s), or a tf2_msgs/TFMessage in JSON."""
    found = []
    for item in getattr(message, "transforms", [message]):
        if hasattr(item, "transform"):
            stamp, parent = head(item)
            child, t, r = item.child_frame_id, item.transform.translation, item.transform.rotation
        else:
            stamp, parent = _stamp(item.timestamp), str(item.parent_frame_id).lstrip("/")
            child, t, r = item.child_frame_id, item.translation, item.rotation
        found.append(
            Transform(
                -1 if stamp is None else stamp,
                parent,
                str(child).lstrip("/"),
                (float(t.x), float(t.y), float(t.z)),
                (float(r.w), float(r.x), float(r.y), float(r.z)),
                static,
            )
        )
    return found


def event(type_name: str, kind: str, message: Any, topic: str) -> Event:
    """The event of any Foxglove message but transforms."""
    stamp, frame = head(message)
    if stamp is None:
        raise ValueError("bad stamp")
    if type_name == "foxglove.LaserScan":
        return _scan(stamp, frame, message)
    if type_name == "foxglove.PoseInFrame":
        place, q = message.pose.position, message.pose.orientation
        yaw = canonical_yaw(yaw_of((float(q.w), float(q.x), float(q.y), float(q.z))))
        return Odometry(stamp, frame, float(place.x), float(place.y), yaw)
    if type_name == "foxglove.CameraCalibration":
        return CameraInfo(
            stamp,
            frame,
            int(message.width),
            int(message.height),
            readonly(np.reshape(message.K, (3, 3)), np.float64),
            readonly(np.reshape(message.P, (3, 4)), np.float64),
            readonly(message.D, np.float64),
            camera_of(topic),
        )
    data = _bytes(message.data)
    if type_name == "foxglove.CompressedImage":
        return Image(stamp, frame, readonly(unpack_picture(data), np.uint8), camera_of(topic))
    size = str(message.encoding), int(message.height), int(message.width), int(message.step), data
    if kind == "depth":
        return DepthImage(stamp, frame, readonly(depth_of(*size, False), np.float32), camera_of(topic))
    return Image(stamp, frame, readonly(pixels_of(*size), np.uint8), camera_of(topic))


def _scan(stamp: int, frame: str, message: Any) -> LaserScan:
    """Angles run from start_angle to end_angle inclusive; there are no range limits in the type."""
    ranges = np.array([np.nan if r is None else r for r in message.ranges], dtype=np.float32)
    span = float(message.end_angle) - float(message.start_angle)
    return LaserScan(
        stamp,
        frame,
        readonly(ranges, np.float32),
        as_float32(message.start_angle),
        as_float32(span / max(len(ranges) - 1, 1)),
        0.0,
        float("inf"),
    )


def _stamp(stamp: Any) -> int | None:
    seconds = getattr(stamp, "sec", getattr(stamp, "secs", None))
    nanoseconds = getattr(stamp, "nsec", getattr(stamp, "nanosec", getattr(stamp, "nsecs", 0)))
    if not isinstance(seconds, int) or not isinstance(nanoseconds, int):
        return None
    return join_stamp(seconds, nanoseconds)


def _bytes(data: str) -> bytes:
    try:
        return base64.b64decode(data, validate=True)
    except binascii.Error as error:
        raise ValueError("data is not base64") from error
