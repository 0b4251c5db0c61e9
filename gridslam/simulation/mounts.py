"""Where sensors sit on the robot."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Transform
from gridslam.simulation.encoders import BASE_FRAME
from gridslam.simulation.sensor_config import Mounting


def planar(mounting: Mounting) -> NDArray[np.float64]:
    """T_base_sensor in the plane."""
    return np.array([mounting.x, mounting.y, math.radians(mounting.yaw_deg)])


def static_transform(mounting: Mounting, frame: str, stamp_ns: int) -> Transform:
    """The message that tells a sensor's mounting: yaw about the vertical, then pitch (down is positive)."""
    half_yaw, half_pitch = 0.5 * math.radians(mounting.yaw_deg), 0.5 * math.radians(mounting.pitch_deg)
    cy, sy, cp, sp = math.cos(half_yaw), math.sin(half_yaw), math.cos(half_pitch), math.sin(half_pitch)
    turn = (cy * cp, -sy * sp, cy * sp, sy * cp)
    return Transform(stamp_ns, BASE_FRAME, frame, (mounting.x, mounting.y, mounting.z), turn, True)
