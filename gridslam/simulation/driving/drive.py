"""The differential drive: wheel acceleration, slip and geometry errors, and the pose that results."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.simulation.driving.grip import Grip
from gridslam.simulation.driving.robot_config import Wheels
from gridslam.simulation.shapes import PoseDeg

STEP_NS = 10_000_000
STEP_S = STEP_NS * 1e-9
_DRAWS_AT_ONCE = 4096


@dataclass(frozen=True, slots=True)
class TrueWheels:
    """The true wheel radii and wheel base, which differ from the nominal ones."""

    left_radius_m: float
    right_radius_m: float
    base_m: float


class DrivenRobot:
    """True state of the robot, advanced in steps of 10 ms. Yaw is not wrapped, so that it can be interpolated."""

    def __init__(self, wheels: Wheels, start: PoseDeg, rng: np.random.Generator) -> None:
        self.wheels = wheels
        errors = wheels.error_deviation * rng.standard_normal(3)
        self.true = TrueWheels(
            wheels.radius_m * (1.0 + wheels.left_radius_error + float(errors[0])),
            wheels.radius_m * (1.0 + wheels.right_radius_error + float(errors[1])),
            wheels.base_m * (1.0 + wheels.base_error + float(errors[2])),
        )
        self.x, self.y, self.yaw = start[0], start[1], math.radians(start[2])
        self.left_rad = self.right_rad = 0.0  # wheel angles
        self.left_radps = self.right_radps = 0.0
        self.v_mps = self.w_radps = 0.0
        self.distance_m = 0.0
        self._slips = [0.0, 0.0]
        self._slip_decay = math.exp(-STEP_S / wheels.slip_correlation_time_s)
        self._slip_noise = wheels.slip_deviation * math.sqrt(1.0 - self._slip_decay**2)
        self._rng = rng
        self._draws: list[float] = []
        self._grip = Grip(wheels.grip_losses, rng) if wheels.grip_losses else None
        self._steps = 0
        self._history = np.empty((4096, 3))
        self._history[0] = self.x, self.y, self.yaw

    @property
    def time_s(self) -> float:
        """Simulated time (s) since the start."""
        return self._steps * STEP_S

    @property
    def pose(self) -> NDArray[np.float64]:
        """T_map_base `(3,)`: x, y (m), yaw (rad, not wrapped)."""
        return np.array([self.x, self.y, self.yaw])

    def step(self, left_radps: float, right_radps: float) -> None:
        """Advance by 10 ms. The wheel speeds approach the commanded ones at the drive's acceleration."""
        max_change = self.wheels.acceleration_mps2 / self.wheels.radius_m * STEP_S
        limit = self.wheels.max_speed_mps / self.wheels.radius_m
        self.left_radps = _towards(self.left_radps, min(max(left_radps, -limit), limit), max_change)
        self.right_radps = _towards(self.right_radps, min(max(right_radps, -limit), limit), max_change)
        self.left_rad += self.left_radps * STEP_S
        self.right_rad += self.right_radps * STEP_S
        left_slip, right_slip = self._next_slips()
        left = self.left_radps * STEP_S * self.true.left_radius_m * (1.0 - left_slip)
        right = self.right_radps * STEP_S * self.true.right_radius_m * (1.0 - right_slip)
        if self._grip:
            left, right = self._grip.kept(left, right)
        forward, rotation = 0.5 * (left + right), (right - left) / self.true.base_m
        rotation *= 1.0 - self.wheels.turn_slip
        mid_yaw = self.yaw + 0.5 * rotation
        self.x += forward * math.cos(mid_yaw)
        self.y += forward * math.sin(mid_yaw)
        self.yaw += rotation
        self.distance_m += abs(forward)
        self.v_mps, self.w_radps = forward / STEP_S, rotation / STEP_S
        self._record()

    def poses_at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """True poses `(n, 3)` at past times `(n,)` (s), linear between steps; the first pose before the start."""
        at = np.clip(np.asarray(times_s) / STEP_S, 0.0, self._steps)
        before = np.minimum(at.astype(np.int64), max(self._steps - 1, 0))
        after = np.minimum(before + 1, self._steps)
        fraction = (at - before)[:, None]
        poses = self._history[before] * (1.0 - fraction) + self._history[after] * fraction
        return np.asarray(poses)

    def _record(self) -> None:
        self._steps += 1
        if self._steps == len(self._history):
            self._history = np.concatenate([self._history, np.empty_like(self._history)])
        self._history[self._steps] = self.x, self.y, self.yaw

    def _next_slips(self) -> tuple[float, float]:
        """Slip of both wheels: first-order processes around the mean."""
        if not self._slip_noise:
            return self.wheels.slip_mean, self.wheels.slip_mean
        if not self._draws:
            self._draws = self._rng.standard_normal(_DRAWS_AT_ONCE).tolist()
        self._slips[0] = self._slip_decay * self._slips[0] + self._slip_noise * self._draws.pop()
        self._slips[1] = self._slip_decay * self._slips[1] + self._slip_noise * self._draws.pop()
        mean = self.wheels.slip_mean
        return mean + self._slips[0], mean + self._slips[1]


def _towards(value: float, target: float, max_change: float) -> float:
    return value + min(max(target - value, -max_change), max_change)
