"""Codecs of depth images: sensor_msgs/Image, CompressedImage and foxglove.RawImage of depths, and CSV rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from gridslam.core.messages import DepthImage, readonly
from gridslam.logs.codecs.image import write_picture
from gridslam.logs.encoding.cameras import DEPTH_ENCODINGS, camera_of, depth_of
from gridslam.logs.encoding.csv_fields import name_field
from gridslam.logs.encoding.csv_pictures import PictureWriter, read_floats
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.foxglove_fields import base64_bytes
from gridslam.logs.encoding.image_encodings import compressed_depth
from gridslam.logs.encoding.ros_fields import valid_head


def is_depth(message: Any, topic: str) -> bool:
    """Whether an image message, raw or compressed, holds depths rather than colours.

    Depths are 16UC1 or 32FC1; 16-bit grey (mono16) is depth if the topic says so.
    """
    described = str(getattr(message, "encoding", "") or getattr(message, "format", ""))
    encoding = described.split(";")[0].strip()
    return encoding in DEPTH_ENCODINGS or (encoding == "mono16" and "depth" in topic.lower())


def from_compressed(message: Any, topic: str) -> DepthImage:
    """The depths in a sensor_msgs/CompressedImage."""
    depth = compressed_depth(bytes(message.data), str(message.format))
    return DepthImage(*valid_head(message), readonly(depth, np.float32), camera_of(topic))


def from_ros(message: Any, topic: str) -> DepthImage:
    """The depths in a sensor_msgs/Image."""
    depth = depth_of(
        str(message.encoding),
        height=int(message.height),
        width=int(message.width),
        step=int(message.step),
        data=bytes(message.data),
        is_bigendian=bool(message.is_bigendian),
    )
    return DepthImage(*valid_head(message), readonly(depth, np.float32), camera_of(topic))


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> DepthImage:
    """The depths in a foxglove.RawImage."""
    depth = depth_of(
        str(message.encoding),
        height=int(message.height),
        width=int(message.width),
        step=int(message.step),
        data=base64_bytes(message.data),
        is_bigendian=False,
    )
    return DepthImage(stamp_ns, frame, readonly(depth, np.float32), camera_of(topic))


def to_ros(depth: DepthImage, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/Image of float32 metres."""
    body = write_picture(with_header(depth), "32FC1", depth.depth_m, 4)
    return single_message(topic or f"/{depth.camera or 'camera'}/depth", "sensor_msgs/msg/Image", depth, body)


def from_csv(rows: list[Row]) -> DepthImage:
    """The depths in the file that one row names."""
    (row,) = rows
    depth = readonly(read_floats(row.file()), np.float32)
    return DepthImage(row.stamp_ns, row.frame, depth, row.text("camera"))


def to_csv(depth: DepthImage, pictures: PictureWriter) -> list[list[str]]:
    """One row with the name of a .npy file, which is written."""
    name = pictures.write_floats("depth", depth, depth.depth_m)
    return [[name_field(depth.camera), name, name_field(depth.frame_id)]]
