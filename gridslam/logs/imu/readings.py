"""Time series of an IMU and of the odometry, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Stamps = NDArray[np.int64]

SPEED_STEP_S = 0.3  # duration over which the odometry's speed is taken
MAX_GAP_S = 0.2  # a longer gap between readings says nothing of the tilt within


@dataclass(frozen=True, slots=True)
class ImuReadings:
    """`stamps_ns` int64 `(n,)`, ascending; quaternions w, x, y, z `(n, 4)`, turn rates `(n, 3)` (rad/s) and specific forces
    `(n, 3)` (m/s^2) in the sensor's frame, NaN where not measured.
    """

    stamps_ns: Stamps
    quats: Floats
    rates: Floats
    forces: Floats


@dataclass(frozen=True, slots=True)
class OdometryReference:
    """Headings `(n,)` (rad) and positions `(n, 2)` (m) of the odometry at `stamps_ns` `(n,)`."""

    stamps_ns: Stamps
    yaws: Floats
    positions: Floats

    def speeds_at(self, stamps_ns: Stamps) -> Floats:
        """Forward speeds `(k,)` (m/s) at stamps `(k,)`, by central differences over `SPEED_STEP_S`."""
        times, own = stamps_ns * 1e-9, self.stamps_ns * 1e-9
        before, after = (
            np.column_stack([np.interp(times + shift, own, column) for column in self.positions.T])
            for shift in (-0.5 * SPEED_STEP_S, 0.5 * SPEED_STEP_S)
        )
        yaw = np.interp(times, own, np.unwrap(self.yaws))
        moved = after - before
        return np.asarray((moved[:, 0] * np.cos(yaw) + moved[:, 1] * np.sin(yaw)) / SPEED_STEP_S)
