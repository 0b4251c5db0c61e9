"""The limits of the robot of the planner's tests and benchmarks."""

from __future__ import annotations

from gridslam.kernels.planning.drive_limits import DriveLimits

LIMITS = DriveLimits(
    top_speed=1.0,
    lateral_acceleration=0.5,
    yaw_rate=1.5,
    acceleration=0.5,
    deceleration=0.5,
    yaw_acceleration=2.0,
)
