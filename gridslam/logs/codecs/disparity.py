"""Codecs of disparity images: stereo_msgs/DisparityImage and CSV rows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gridslam.core.messages import Disparity, as_float32, readonly
from gridslam.logs.codecs.image import write_picture
from gridslam.logs.encoding.cameras import camera_of, depth_of
from gridslam.logs.encoding.csv_fields import name_field, single_field
from gridslam.logs.encoding.csv_pictures import PictureWriter, read_floats
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import valid_head
from gridslam.logs.skips import SkipReason, UnusableMessageError


def unusable_reason(disparity: Disparity) -> SkipReason | None:
    """The reason why no method can use the disparities; None if it can."""
    is_finite = math.isfinite(disparity.focal_px) and math.isfinite(disparity.baseline_m)
    return None if is_finite else SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> Disparity:
    """The disparities in a stereo_msgs/DisparityImage.

    Values that are not finite or below the message's smallest disparity mean no match, and become NaN.
    """
    picture = message.image
    if str(picture.encoding) != "32FC1":
        raise UnusableMessageError(SkipReason.UNKNOWN_ENCODING)
    values = depth_of(
        "32FC1",
        height=int(picture.height),
        width=int(picture.width),
        step=int(picture.step),
        data=bytes(picture.data),
        is_bigendian=bool(picture.is_bigendian),
    )
    with np.errstate(invalid="ignore"):
        values = np.where(
            np.isfinite(values) & (values >= as_float32(message.min_disparity)), values, np.float32(np.nan)
        )
    return Disparity(
        *valid_head(message),
        readonly(values, np.float32),
        focal_px=as_float32(message.f),
        baseline_m=as_float32(message.t),
        camera=camera_of(topic),
    )


def to_ros(disparity: Disparity, topic: str | None) -> list[Encoded]:
    """One stereo_msgs/DisparityImage."""
    body = with_header(disparity).header(disparity.stamp_ns, disparity.frame_id)
    write_picture(body, "32FC1", disparity.disparity_px, 4)
    body.float32(disparity.focal_px, disparity.baseline_m)
    min_disparity, max_disparity = 0.0, as_float32(disparity.disparity_px.shape[1])
    body.uint32(0, 0, 0, 0).uint8(0)  # the valid window: not stated
    body.float32(min_disparity, max_disparity, 0.0)
    name = topic or f"/{disparity.camera or 'camera'}/disparity"
    return single_message(name, "stereo_msgs/msg/DisparityImage", disparity, body)


def from_csv(rows: list[Row]) -> Disparity:
    """The disparities in the file that one row names."""
    (row,) = rows
    return Disparity(
        row.stamp_ns,
        row.frame,
        readonly(read_floats(row.file()), np.float32),
        focal_px=as_float32(row.number("focal")),
        baseline_m=as_float32(row.number("baseline")),
        camera=row.text("camera"),
    )


def to_csv(disparity: Disparity, pictures: PictureWriter) -> list[list[str]]:
    """One row with the name of a .npy file, which is written."""
    name = pictures.write_floats("disparity", disparity, disparity.disparity_px)
    numbers = [single_field(disparity.focal_px), single_field(disparity.baseline_m)]
    return [[name_field(disparity.camera), name, *numbers, name_field(disparity.frame_id)]]
