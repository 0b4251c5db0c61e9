"""Sensor extrinsics as poses and as static transforms."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Transform
from gridslam.simulation.sensors.encoders import BASE_FRAME
from gridslam.simulation.sensors.sensor_config import SensorExtrinsics


def planar(extrinsics: SensorExtrinsics) -> NDArray[np.float64]:
    """T_base_sensor `(3,)` in the plane: x, y (m), yaw (rad)."""
    return np.array([extrinsics.x, extrinsics.y, math.radians(extrinsics.yaw_deg)])


def static_transform(extrinsics: SensorExtrinsics, frame: str, stamp_ns: int) -> Transform:
    """T_base_sensor as a static transform: yaw about the vertical, then pitch (positive downwards)."""
    half_yaw, half_pitch = 0.5 * math.radians(extrinsics.yaw_deg), 0.5 * math.radians(extrinsics.pitch_deg)
    cy, sy, cp, sp = math.cos(half_yaw), math.sin(half_yaw), math.cos(half_pitch), math.sin(half_pitch)
    quat_wxyz = (cy * cp, -sy * sp, cy * sp, sy * cp)
    return Transform(
        stamp_ns,
        BASE_FRAME,
        child_frame_id=frame,
        translation_m=(extrinsics.x, extrinsics.y, extrinsics.z),
        quat_wxyz=quat_wxyz,
        is_static=True,
    )
