"""How fast a path of lines and arcs can be driven: on an arc its radius limits the speed (stereo-bayes, paper section 2.5)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.kernels.planning.circles import part_time, travel_time
from gridslam.planning.path import ArcLinePath, Kind, Segment

Floats = NDArray[np.float64]

LEAST_LIMIT, MOST_LIMIT = 1e-3, 1e3  # of speeds and accelerations
NOTHING = 1e-9  # lengths (m) and angles (rad) that are none


@dataclass(frozen=True, slots=True)
class SpeedLimits:
    """What the robot can do: speed, v^2 / r and v / r on an arc, dv/dt, and turns on the spot."""

    top_speed_mps: float = 1.0
    lateral_mps2: float = 0.5
    turn_rate_radps: float = 1.5
    acceleration_mps2: float = 0.5
    turn_acceleration_radps2: float = 2.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not LEAST_LIMIT <= value <= MOST_LIMIT:
                raise ConfigError(
                    f"{field.name} {value:g}: expected a number from {LEAST_LIMIT:g} to {MOST_LIMIT:g}"
                )

    @property
    def for_kernels(self) -> Floats:
        """The limits as the kernels take them."""
        a = self.acceleration_mps2
        return np.array(
            [
                self.top_speed_mps,
                self.lateral_mps2,
                self.turn_rate_radps,
                a,
                a,
                self.turn_acceleration_radps2,
            ]
        )


def parts_of(start: Floats, motions: Floats) -> Floats:
    """The kernels' parts `(n, 6)` of motions `(n, 2)` (length, curvature) from a pose `(3,)`."""
    parts = np.zeros((len(motions), 6))
    pose = start
    for part, (length, curvature) in zip(parts, motions, strict=True):
        part[:5] = (*pose, length, curvature)
        pose = _segment(part, np.zeros(2), np.ones(6)).end
    return parts


def time_of(parts: Floats, limits: SpeedLimits) -> float:
    """Least time (s) from rest to rest over parts `(n, 6)`."""
    return float(travel_time(parts, limits.for_kernels, np.empty(len(parts) + 1)))


def timed_path(parts: Floats, limits: SpeedLimits) -> ArcLinePath:
    """The path of parts `(n, 6)` of the kernels, driven in the least time from rest to rest; empty parts are left out."""
    kept = parts[(np.abs(parts[:, 3]) > NOTHING) | (np.abs(parts[:, 5]) > NOTHING)]
    speeds = np.empty(len(kept) + 1)
    travel_time(kept, limits.for_kernels, speeds)
    pairs = zip(kept, np.column_stack([speeds[:-1], speeds[1:]]), strict=True)
    return ArcLinePath(tuple(_segment(part, pair, limits.for_kernels) for part, pair in pairs))


def _segment(part: Floats, speeds: Floats, limits: Floats) -> Segment:
    x, y, yaw, length, curvature, angle = (float(v) for v in part)
    v0, v1, a = float(speeds[0]), float(speeds[1]), float(limits[3])
    time = float(part_time(part, v0, v1, limits))
    if abs(angle) > NOTHING:
        return Segment("turn", x, y, yaw, 0.0, 0.0, angle, 0.0, 0.0, 0.0, 0.0, 0.0, time)
    k = abs(curvature)
    cap = min([limits[0], *([np.sqrt(limits[1] / k), limits[2] / k] if k > 0.0 else [])])
    peak = max(min(float(cap), float(np.sqrt(a * abs(length) + 0.5 * (v0 * v0 + v1 * v1)))), v0, v1)
    kind: Kind = "arc" if curvature else "line"
    rise, fall = (peak - v0) / a, (peak - v1) / a
    return Segment(kind, x, y, yaw, length, curvature, length * curvature, v0, peak, v1, rise, fall, time)
