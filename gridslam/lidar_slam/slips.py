"""Uncertainty of matching without odometry along corridors, where the surfaces do not determine the motion."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.front_end import ScanMatch

Floats = NDArray[np.float64]

# Standard deviation of a match from which noise decides about the motion in this direction
WEAK_STD_M = 0.015
# Variance a metre of motion: on recorded corridors tracks without odometry slip by up to 4 m in 10 m
SLIP_M2_PER_M = 1.0
MIN_SPEED_MPS = 0.05  # speed assumed for a robot that seems to stand where its motion is not observed
MAX_GAP_S = 1.0  # after a longer gap a scan may be matched elsewhere
# Slip of a scan after a gap, or that is not matched, in any direction
UNMATCHED_MPS, MAX_UNMATCHED_S = 0.5, 1.0


def slip_variances(step: Floats, elapsed_s: float, match: ScanMatch) -> Floats:
    """Variances `(3,)` of x, y (m^2) and yaw by which a step `(3,)` over some time (s) may have slipped; of yaw there is none."""
    if match.weakest_m is None or not match.is_matched or elapsed_s > MAX_GAP_S:
        variance_m2 = (UNMATCHED_MPS * min(max(elapsed_s, 0.0), MAX_UNMATCHED_S)) ** 2
        return np.array([variance_m2, variance_m2, 0.0])
    if match.position_std_m < WEAK_STD_M:
        return np.zeros(3)
    moved_m = max(math.hypot(*step[:2].tolist()), MIN_SPEED_MPS * elapsed_s)
    x, y = match.weakest_m.tolist()
    along = math.cos(math.atan2(y, x) - float(match.pose[2])) ** 2
    return SLIP_M2_PER_M * moved_m * np.array([along, 1.0 - along, 0.0])
