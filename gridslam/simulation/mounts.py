"""Where sensors sit on the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Transform
from gridslam.simulation.encoders import BASE_FRAME
from gridslam.simulation.sensor_config import SensorExtrinsics


def planar(extrinsics: SensorExtrinsics) -> NDArray[np.float64]:
    """T_base_sensor in the plane."""
    return np.array([extrinsics.x, extrinsics.y, math.radians(extrinsics.yaw_deg)])


def static_transform(extrinsics: SensorExtrinsics, frame: str, stamp_ns: int) -> Transform:
    """The message that tells a sensor's extrinsics: yaw about the vertical, then pitch (down is positive)."""
    half_yaw, half_pitch = 0.5 * math.radians(extrinsics.yaw_deg), 0.5 * math.radians(extrinsics.pitch_deg)
    cy, sy, cp, sp = math.cos(half_yaw), math.sin(half_yaw), math.cos(half_pitch), math.sin(half_pitch)
    turn = (cy * cp, -sy * sp, cy * sp, sy * cp)
    return Transform(stamp_ns, BASE_FRAME, frame, (extrinsics.x, extrinsics.y, extrinsics.z), turn, True)
