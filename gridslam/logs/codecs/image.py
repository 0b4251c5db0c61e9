"""Codecs of camera images: sensor_msgs/Image and CompressedImage, foxglove.RawImage and CompressedImage, and CSV rows."""

from __future__ import annotations

from typing import Any

import numpy as np

from gridslam.core.messages import Event, Image, StereoPair, readonly
from gridslam.logs.encoding.cameras import camera_of
from gridslam.logs.encoding.cdr import CdrWriter
from gridslam.logs.encoding.csv_fields import name_field
from gridslam.logs.encoding.csv_pictures import PictureWriter, read_pixels
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.foxglove_fields import base64_bytes
from gridslam.logs.encoding.image_encodings import RawImage, compressed_pixels, pixels_of
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.stereo import is_raw


def from_ros(message: Any, topic: str) -> Image:
    """The image in a sensor_msgs/Image, grey or RGB."""
    raw = RawImage(
        str(message.encoding),
        height=int(message.height),
        width=int(message.width),
        step=int(message.step),
        data=bytes(message.data),
        is_bigendian=bool(message.is_bigendian),
    )
    pixels = pixels_of(raw)
    return Image(*valid_head(message), readonly(pixels, np.uint8), camera_of(topic), is_raw(topic))


def from_compressed(message: Any, topic: str) -> Image:
    """The image in a sensor_msgs/CompressedImage."""
    pixels = compressed_pixels(bytes(message.data), str(message.format))
    return Image(*valid_head(message), readonly(pixels, np.uint8), camera_of(topic), is_raw(topic))


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> Image:
    """The image in a foxglove.RawImage."""
    raw = RawImage(
        str(message.encoding),
        height=int(message.height),
        width=int(message.width),
        step=int(message.step),
        data=base64_bytes(message.data),
    )
    pixels = pixels_of(raw)
    return Image(stamp_ns, frame, readonly(pixels, np.uint8), camera_of(topic), is_raw(topic))


def from_foxglove_compressed(stamp_ns: int, frame: str, message: Any, topic: str) -> Image:
    """The image in a foxglove.CompressedImage."""
    pixels = compressed_pixels(base64_bytes(message.data), str(getattr(message, "format", "")))
    return Image(stamp_ns, frame, readonly(pixels, np.uint8), camera_of(topic), is_raw(topic))


def write_picture(body: CdrWriter, encoding: str, pixels: Any, bytes_per_pixel: int) -> CdrWriter:
    """Append the fields of a sensor_msgs/Image that come after its header."""
    height, width = pixels.shape[:2]
    body.uint32(height, width).text(encoding).uint8(0).uint32(width * bytes_per_pixel)
    raw = np.ascontiguousarray(pixels).astype(pixels.dtype.newbyteorder("<"), copy=False)
    return body.sequence(raw.reshape(-1).view(np.uint8), 1)


def to_ros(image: Image, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/Image."""
    encoding, bytes_per_pixel = ("mono8", 1) if image.pixels.ndim == 2 else ("rgb8", 3)
    body = write_picture(with_header(image), encoding, image.pixels, bytes_per_pixel)
    name = topic or f"/{image.camera or 'camera'}/{'image_raw' if image.is_raw else 'image'}"
    return single_message(name, "sensor_msgs/msg/Image", image, body)


def stereo_to_ros(pair: StereoPair, topic: str | None) -> list[Encoded]:
    """Two sensor_msgs/Image, left and right."""
    messages = []
    for side, pixels in (("left", pair.left), ("right", pair.right)):
        body = write_picture(with_header(pair), "mono8", pixels, 1)
        messages += single_message(
            f"{topic or '/stereo'}/{side}/image_{'raw' if pair.is_raw else 'rect'}",
            "sensor_msgs/msg/Image",
            pair,
            body,
        )
    return messages


def stereo_to_images(pair: StereoPair, topic: str | None) -> list[tuple[Event, str]]:
    """The left and the right image of a pair with their topics, as a CSV folder holds them."""
    found: list[tuple[Event, str]] = []
    for side, pixels in (("left", pair.left), ("right", pair.right)):
        camera = f"{(topic or 'stereo').strip('/')}/{side}"
        found.append((Image(pair.stamp_ns, pair.frame_id, pixels, camera), f"/{camera}/image_rect"))
    return found


def from_csv(rows: list[Row]) -> Image:
    """The image in the file that one row names."""
    (row,) = rows
    pixels = readonly(read_pixels(row.file()), np.uint8)
    return Image(row.stamp_ns, row.frame, pixels, row.text("camera"), bool(row.number("raw", 0.0)))


def to_csv(image: Image, pictures: PictureWriter) -> list[list[str]]:
    """One row with the name of a PNG file, which is written."""
    name = pictures.write_pixels("image", image, image.pixels)
    return [[name_field(image.camera), name, str(int(image.is_raw)), name_field(image.frame_id)]]
