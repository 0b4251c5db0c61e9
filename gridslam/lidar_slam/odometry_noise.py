"""Noise of one odometry step between two scans."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.config import OdometryConfig
from gridslam.motion.odometry_limits import OdometryLimits

Floats = NDArray[np.float64]

# Standard deviation for a standing robot: encoder ticks and stamps that are not exact
TRANSLATION_FLOOR_M = 0.01
ROTATION_FLOOR_RAD = 0.005
TRANSLATION_PER_RAD_M = 0.02  # a wheelbase that is not exact moves the robot as it turns
ROTATION_PER_M_RAD = 0.1  # wheels of unequal diameter turn the robot as it drives
ACCELERATION_NOISE = 0.3  # std per unit of change since the last step: odometry that stutters is trusted less
# Between scans this far apart odometry alone measures the motion, and what matching finds then may be a place that looks alike
MIN_UNSCANNED_M = 3.0
# Standard deviations of odometry over such a distance, generous because searches go no farther: relative to the distance, and
# of the heading by metre and by radian
DISTANCE_ERROR, HEADING_PER_M_RAD, HEADING_PER_RAD = 0.1, 0.01, 0.05
NO_MIN_STD: Floats = np.zeros(3)
# (m, m, rad): the motion during a jump of the odometry is unknown but short
JUMP_STD: Floats = np.array([0.3, 0.3, 0.3])
JUMP_TOLERANCE_M = 0.5  # stamps may be off by a tenth of a second
JUMP_TOLERANCE_RAD = 0.5


def odometry_std(
    step: Floats, expected_step: Floats, config: OdometryConfig, min_std: Floats = NO_MIN_STD
) -> Floats:
    """Standard deviations (x, y, yaw) `(3,)` of an odometry step `(3,)` in the robot's frame, at least `min_std` `(3,)`.

    They grow with the motion and with the difference from `expected_step` `(3,)`, the motion at constant velocity. After a
    gap in the scans they are those of a long step.
    """
    (x, y, yaw), (expected_x, expected_y, expected_yaw) = step.tolist(), expected_step.tolist()
    distance_m, rotation_rad = math.hypot(x, y), abs(yaw)
    if distance_m >= MIN_UNSCANNED_M:
        return np.asarray(np.maximum(unscanned_std(step), min_std))
    translation = (
        TRANSLATION_FLOOR_M + config.translation_per_m * distance_m + TRANSLATION_PER_RAD_M * rotation_rad
    )
    rotation = ROTATION_FLOOR_RAD + config.rotation_per_rad * rotation_rad + ROTATION_PER_M_RAD * distance_m
    translation += ACCELERATION_NOISE * math.hypot(x - expected_x, y - expected_y)
    rotation += ACCELERATION_NOISE * min(abs(yaw - expected_yaw), math.pi)
    return np.asarray(np.maximum((translation, translation, rotation), min_std))


def unscanned_std(step: Floats) -> Floats:
    """Standard deviations (x, y, yaw) `(3,)` of a long step `(3,)` by odometry alone, between scans; zero for a short one.

    They are smaller than those of as many short steps: of these, each may be one that slipped or stuttered.
    """
    travel_m, rotation_rad = math.hypot(*step[:2].tolist()), abs(float(step[2]))
    if travel_m < MIN_UNSCANNED_M:
        return np.zeros(3)
    position_m = DISTANCE_ERROR * travel_m
    return np.array([position_m, position_m, HEADING_PER_M_RAD * travel_m + HEADING_PER_RAD * rotation_rad])


def odometry_limits(config: OdometryConfig) -> OdometryLimits:
    """Limits beyond which odometry has jumped."""
    return OdometryLimits(
        config.max_speed_mps, config.max_yaw_rate_radps, JUMP_TOLERANCE_M, JUMP_TOLERANCE_RAD
    )
