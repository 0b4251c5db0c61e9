"""Which values no method can work with, whatever it does."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gridslam.core.messages import (
    AbsolutePose,
    Event,
    Imu,
    LaserScan,
    Odometry,
    Range,
    Transform,
    WheelTicks,
)

# A sweep may overlap itself a little (some lidars do), not go round twice.
_WIDEST_SWEEP_RAD = 2.0 * math.pi * 1.05

_FARTHEST_M = 1e9  # from frame to frame: what is composed of such steps is still a number


def fault_of(event: Event) -> str | None:
    """Why the event cannot be used, as the last part of a counter's name; None when it can."""
    check = _CHECKS.get(type(event))
    return check(event) if check else None


def _scan(scan: LaserScan) -> str | None:
    beams = len(scan.ranges_m)
    if beams == 0:
        return "no_beams"
    increment = scan.angle_increment_rad
    if not (math.isfinite(increment) and math.isfinite(scan.angle_min_rad)):
        return "bad_angles"
    if beams > 1 and (increment == 0.0 or abs(increment) * (beams - 1) > _WIDEST_SWEEP_RAD):
        return "bad_angles"
    if not scan.range_max_m > max(scan.range_min_m, 0.0):  # NaN fails too
        return "bad_range_limits"
    return None


def _odometry(odometry: Odometry) -> str | None:
    # Each by itself: the sum of finite numbers may overflow.
    if math.isfinite(odometry.x_m) and math.isfinite(odometry.y_m) and math.isfinite(odometry.yaw_rad):
        return None
    return "not_finite"


def _imu(imu: Imu) -> str | None:
    return None if math.isfinite(imu.wz_radps) else "not_finite"


def _wheels(ticks: WheelTicks) -> str | None:
    return None if math.isfinite(ticks.left_rad) and math.isfinite(ticks.right_rad) else "not_finite"


def _range(reading: Range) -> str | None:
    if not math.isfinite(reading.bearing_rad):
        return "not_finite"
    return None if reading.range_max_m > max(reading.range_min_m, 0.0) else "bad_range_limits"


def _fix(fix: AbsolutePose) -> str | None:
    if not (np.isfinite(fix.pose).all() and np.isfinite(fix.covariance).all()):
        return "not_finite"
    return "bad_covariance" if (np.diag(fix.covariance) < 0.0).any() else None


def _transform(transform: Transform) -> str | None:
    if not all(map(math.isfinite, transform.translation_m)):
        return "not_finite"
    if max(map(abs, transform.translation_m)) > _FARTHEST_M:
        return "too_far"
    norm = math.sqrt(sum(c * c for c in transform.quat_wxyz))
    return None if math.isfinite(norm) and norm > 1e-6 else "not_finite"


_CHECKS: dict[type, Callable[..., str | None]] = {
    LaserScan: _scan,
    Odometry: _odometry,
    Imu: _imu,
    WheelTicks: _wheels,
    Range: _range,
    AbsolutePose: _fix,
    Transform: _transform,
}
