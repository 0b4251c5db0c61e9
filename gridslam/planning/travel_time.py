"""Speeds on a path of lines and arcs, where the radius of an arc limits the speed (stereo-bayes, paper section 2.5)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.kernels.planning.circles import part_time, travel_time
from gridslam.kernels.planning.drive_limits import ANGLE, LENGTH, DriveLimits, speed_on
from gridslam.planning.path import ArcLinePath, Kind, Segment

Floats = NDArray[np.float64]

MIN_LIMIT, MAX_LIMIT = 1e-3, 1e3  # limits of every speed and acceleration
ZERO = 1e-9  # lengths (m) and angles (rad) below this count as 0
UNIT_LIMITS = DriveLimits(*[1.0] * 6)  # for segments of which only the geometry is used


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """Limits of the robot: speed v, v^2 / r and v / r on an arc of radius r, dv/dt, and yaw acceleration in a turn on the spot.

    Raises ConfigError if a limit is not between MIN_LIMIT and MAX_LIMIT.
    """

    top_speed_mps: float = 1.0
    lateral_mps2: float = 0.5
    turn_rate_radps: float = 1.5
    acceleration_mps2: float = 0.5
    turn_acceleration_radps2: float = 2.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not MIN_LIMIT <= value <= MAX_LIMIT:
                raise ConfigError(
                    f"{field.name} {value:g}: expected a number from {MIN_LIMIT:g} to {MAX_LIMIT:g}"
                )

    @property
    def for_kernels(self) -> DriveLimits:
        """The limits as the kernels take them."""
        return DriveLimits(
            top_speed=self.top_speed_mps,
            lateral_acceleration=self.lateral_mps2,
            yaw_rate=self.turn_rate_radps,
            acceleration=self.acceleration_mps2,
            deceleration=self.acceleration_mps2,
            yaw_acceleration=self.turn_acceleration_radps2,
        )


def parts_of(start: Floats, motions: Floats) -> Floats:
    """The parts `(n, 6)` of motions `(n, 2)` (length, curvature) from a pose `(3,)`."""
    parts = np.zeros((len(motions), 6))
    pose = start
    for part, (length, curvature) in zip(parts, motions, strict=True):
        part[:5] = (*pose, length, curvature)
        pose = _segment(part, np.zeros(2), UNIT_LIMITS).end_pose
    return parts


def travel_time_of(parts: Floats, limits: SpeedLimits) -> float:
    """Shortest time (s) from rest to rest over parts `(n, 6)`."""
    return float(travel_time(parts, limits.for_kernels, np.empty(len(parts) + 1)))


def timed_path(parts: Floats, limits: SpeedLimits) -> ArcLinePath:
    """The path of parts `(n, 6)`, driven in the shortest time from rest to rest; empty parts are dropped."""
    kept = parts[(np.abs(parts[:, LENGTH]) > ZERO) | (np.abs(parts[:, ANGLE]) > ZERO)]
    speeds = np.empty(len(kept) + 1)
    travel_time(kept, limits.for_kernels, speeds)
    pairs = zip(kept, np.column_stack([speeds[:-1], speeds[1:]]), strict=True)
    return ArcLinePath(tuple(_segment(part, pair, limits.for_kernels) for part, pair in pairs))


def _segment(part: Floats, speeds: Floats, limits: DriveLimits) -> Segment:
    """The segment of a part `(6,)` entered and left at `speeds` `(2,)`."""
    x, y, yaw, length, curvature, angle = (float(v) for v in part)
    v0, v1 = float(speeds[0]), float(speeds[1])
    time = float(part_time(part, v0, v1, limits))
    if abs(angle) > ZERO:
        return Segment("turn", x, y, yaw, angle_rad=angle, time_s=time)
    reachable = float(np.sqrt(limits.acceleration * abs(length) + 0.5 * (v0 * v0 + v1 * v1)))
    peak = max(min(float(speed_on(curvature, limits)), reachable), v0, v1)
    kind: Kind = "arc" if curvature else "line"
    return Segment(
        kind,
        x,
        y,
        yaw,
        length_m=length,
        curvature=curvature,
        angle_rad=length * curvature,
        enter_speed=v0,
        top_speed=peak,
        leave_speed=v1,
        speed_up_s=(peak - v0) / limits.acceleration,
        slow_down_s=(peak - v1) / limits.acceleration,
        time_s=time,
    )
