"""Speed and acceleration limits of the robot, and the columns of the arrays that describe a path."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from gridslam.kernels.compiled import compiled

# Columns of the parts `(n, 6)` of a path: the pose at which a part starts, its length (m, negative: backwards),
# its curvature (1/m, positive: to the left) and the angle (rad) turned on the spot.
X, Y, YAW, LENGTH, CURVATURE, ANGLE = range(6)

STRAIGHT_CURVATURE = 1e-9  # 1/m; anything below is a straight line


class DriveLimits(NamedTuple):
    """Limits on speed (m/s), lateral acceleration (m/s^2), yaw rate (rad/s) and the accelerations that change them."""

    top_speed: float
    lateral_acceleration: float
    yaw_rate: float
    acceleration: float
    deceleration: float
    yaw_acceleration: float


@compiled
def speed_on(curvature: float, limits: DriveLimits) -> float:
    """Highest speed (m/s) on a curvature k (1/m): v^2 k is the lateral acceleration, v k the yaw rate."""
    k = abs(curvature)
    if k < STRAIGHT_CURVATURE:
        return limits.top_speed
    return float(min(limits.top_speed, np.sqrt(limits.lateral_acceleration / k), limits.yaw_rate / k))
