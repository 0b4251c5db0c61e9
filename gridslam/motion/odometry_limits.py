"""Limits of a robot's motion: odometry that exceeds them has jumped."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OdometryLimits:
    """Top speed and yaw rate, and tolerances that allow for stamps that are not exact."""

    max_speed_mps: float
    max_yaw_rate_radps: float
    tolerance_m: float
    tolerance_rad: float

    def has_jumped(self, distance_m: float, rotation_rad: float, elapsed_s: float) -> bool:
        """Whether a motion is longer, or turns farther, than the robot can in the elapsed time."""
        return (
            distance_m > self.tolerance_m + self.max_speed_mps * elapsed_s
            or abs(rotation_rad) > self.tolerance_rad + self.max_yaw_rate_radps * elapsed_s
        )
