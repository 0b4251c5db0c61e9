"""Finds odometry that is late, wrong in scale or in its turns, or mirrored: its motion is compared with that by scan matching."""

from __future__ import annotations

from dataclasses import replace

from gridslam.lidar_slam.sensor_checks.distance_errors import small_error, wrong_scale
from gridslam.lidar_slam.sensor_checks.motion_windows import MotionWindows
from gridslam.lidar_slam.sensor_checks.odometry_correction import OdometryCorrection

# Largest rotation in a window of straight driving: a lidar that sits elsewhere moves alike
MAX_STRAIGHT_RAD = 0.2


def calibrate(windows: MotionWindows | None) -> OdometryCorrection:
    """The faults of odometry by the motions of scan matching alone; without windows, or clear evidence, there are none."""
    if windows is None:
        return OdometryCorrection()
    found = windows.lag_and_sign()
    if found.mirrors_yaw:
        both = [replace(found, mirrors_y=mirrors) for mirrors in (False, True)]
        found = min(both, key=windows.translation_cost)
    found = replace(found, scale=wrong_scale(*windows.distance_ratios(found.lag_s)))
    if found.scale == 1.0:
        straight = windows.distance_ratios(found.lag_s, MAX_STRAIGHT_RAD)
        found = replace(found, distance_ratio=small_error(*straight))
    return replace(found, heading=windows.heading_errors(found))
