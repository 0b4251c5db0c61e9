"""Codecs of camera calibrations: sensor_msgs/CameraInfo, foxglove.CameraCalibration and CSV rows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gridslam.core.messages import CameraInfo, readonly
from gridslam.core.texts import parse_numbers
from gridslam.logs.encoding.cameras import camera_of
from gridslam.logs.encoding.csv_fields import name_field, number_field
from gridslam.logs.encoding.csv_pictures import PictureWriter
from gridslam.logs.encoding.csv_row import Row
from gridslam.logs.encoding.encoded import Encoded, single_message, with_header
from gridslam.logs.encoding.ros_fields import plain_name, valid_head, vector
from gridslam.logs.skips import SkipReason

MAX_SIDE_PX = 1 << 20
# Columns of a table for distortion coefficients: as many as OpenCV's longest model has; further ones are in one text column
DISTORTION_COLUMNS = 14


def unusable_reason(info: CameraInfo) -> SkipReason | None:
    """The reason why no method can use the calibration; None if it can."""
    if not (0 < info.width_px <= MAX_SIDE_PX and 0 < info.height_px <= MAX_SIDE_PX):
        return SkipReason.BAD_IMAGE_SIZE
    is_finite = all(np.isfinite(values).all() for values in (info.K, info.P, info.D, info.R))
    return None if is_finite else SkipReason.NOT_FINITE


def from_ros(message: Any, topic: str) -> CameraInfo:
    """The calibration in a sensor_msgs/CameraInfo."""
    return CameraInfo(
        *valid_head(message),
        width_px=int(message.width),
        height_px=int(message.height),
        K=readonly(np.asarray(message.k).reshape(3, 3), np.float64),
        P=readonly(np.asarray(message.p).reshape(3, 4), np.float64),
        D=vector(message.d, np.float64),
        camera=camera_of(topic),
        R=readonly(np.asarray(message.r).reshape(3, 3), np.float64),
        distortion_model=plain_name(message.distortion_model),
    )


def from_foxglove(stamp_ns: int, frame: str, message: Any, topic: str) -> CameraInfo:
    """The calibration in a foxglove.CameraCalibration."""
    return CameraInfo(
        stamp_ns,
        frame,
        width_px=int(message.width),
        height_px=int(message.height),
        K=readonly(np.reshape(message.K, (3, 3)), np.float64),
        P=readonly(np.reshape(message.P, (3, 4)), np.float64),
        D=vector(message.D, np.float64),
        camera=camera_of(topic),
        R=readonly(np.reshape(message.R, (3, 3)) if getattr(message, "R", None) else np.eye(3), np.float64),
        distortion_model=plain_name(getattr(message, "distortion_model", "")) or "plumb_bob",
    )


def to_ros(info: CameraInfo, topic: str | None) -> list[Encoded]:
    """One sensor_msgs/CameraInfo."""
    body = with_header(info).uint32(info.height_px, info.width_px).text(info.distortion_model)
    body.sequence(np.asarray(info.D, dtype=np.float64), 8)
    for matrix in (info.K, info.R, info.P):
        body.float64(*(float(v) for v in np.ravel(matrix)))
    body.uint32(0, 0).uint32(0, 0, 0, 0).uint8(0)  # no binning; the region of interest is the whole image
    name = topic or f"/{info.camera or 'camera'}/camera_info"
    return single_message(name, "sensor_msgs/msg/CameraInfo", info, body)


def from_csv(rows: list[Row]) -> CameraInfo:
    """The calibration in one row; a missing rotation is the identity."""
    (row,) = rows
    distortion = [row.number(f"d{i}", math.nan) for i in range(DISTORTION_COLUMNS)]
    distortion += parse_numbers(row.text("d_rest").split())
    while distortion and math.isnan(distortion[-1]):
        distortion.pop()
    rotation = [row.number(f"r{i}", float(i % 4 == 0)) for i in range(9)]
    return CameraInfo(
        row.stamp_ns,
        row.frame,
        width_px=whole(row.number("width")),
        height_px=whole(row.number("height")),
        K=readonly(np.array([row.number(f"k{i}") for i in range(9)]).reshape(3, 3), np.float64),
        P=readonly(np.array([row.number(f"p{i}") for i in range(12)]).reshape(3, 4), np.float64),
        D=readonly(np.array(distortion), np.float64),
        camera=row.text("camera"),
        R=readonly(np.array(rotation).reshape(3, 3), np.float64),
        distortion_model=row.text("model", "plumb_bob"),
    )


def whole(value: float) -> int:
    """The number as an integer. Raises ValueError: it is not a whole number."""
    if not value.is_integer():
        raise ValueError(f"{value} is not a whole number")
    return int(value)


def to_csv(info: CameraInfo, pictures: PictureWriter) -> list[list[str]]:
    """One row: camera, size, K, P, D, R and distortion model."""
    numbers = [number_field(float(v)) for v in (*np.ravel(info.K), *np.ravel(info.P))]
    distortion = [number_field(float(v)) for v in info.D]
    rest = " ".join(distortion[DISTORTION_COLUMNS:])
    distortion += [""] * (DISTORTION_COLUMNS - len(distortion))
    rotation = [number_field(float(v)) for v in np.ravel(info.R)]
    size = [str(info.width_px), str(info.height_px)]
    model = name_field(info.distortion_model)
    return [
        [
            name_field(info.camera),
            *size,
            *numbers,
            *distortion[:DISTORTION_COLUMNS],
            *rotation,
            model,
            rest,
            name_field(info.frame_id),
        ]
    ]
