"""Odometry out of encoders and a gyro (ir-scan, paper section 2.6): increments of the wheels, turns mostly by the gyro.

The filter works stretch by stretch: from one stop to the next it gives the relative pose with its covariance, and only the
gyro's bias is carried over. What the map says about a stop therefore never has to be told to the filter.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Imu, Odometry, WheelTicks
from gridslam.kernels import wheel_gyro as kernel

Floats = NDArray[np.float64]

_FASTEST_GYRO_RADPS = 100.0
_NO_GYRO = math.nan


@dataclass(frozen=True, slots=True)
class WheelGyroNoise:
    """Standard deviations; those per root of a metre (radian, second) grow with the root of the way (turn, time)."""

    forward_per_root_m: float = 0.012
    sideways_per_root_m: float = 0.003
    turn_per_root_m: float = 0.06
    turn_per_root_rad: float = 0.03
    turn_per_root_s: float = 1e-5  # of a robot that stands
    gyro_per_root_s: float = 0.001
    gyro_scale: float = 0.003
    bias_radps: float = 0.02
    bias_per_root_s: float = 1e-4
    lost_m: float = 0.3
    lost_rad: float = 0.3

    def variances(self) -> Floats:
        """In the order that the kernel expects."""
        deviations = (
            self.forward_per_root_m,
            self.sideways_per_root_m,
            self.turn_per_root_m,
            self.turn_per_root_rad,
            self.gyro_per_root_s,
            self.gyro_scale,
            self.bias_per_root_s,
            self.lost_m,
            self.lost_rad,
            self.turn_per_root_s,
        )
        return np.square(deviations)


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What no robot does: faster motion is a jump of the counters, a longer silence of the gyro is a gap."""

    max_speed_mps: float = 3.0
    max_turn_radps: float = 10.0
    tolerance_m: float = 0.1
    tolerance_rad: float = 0.3
    gyro_gap_s: float = 0.25


@dataclass(frozen=True, slots=True)
class Stretch:
    """Motion since the last stop: T_stop_now `(3,)`, covariance `(3, 3)`, and the poses on the way `(n, 3)` with their stamps."""

    T_stop_now: Floats
    covariance: Floats
    stamps_ns: NDArray[np.int64]
    path: Floats


class WheelGyro:
    """Collects messages; `advance_to` runs the filter over them.

    With `wheel_radius_m` and `wheel_base_m` wheel angles count and odometry is ignored, else odometry counts. Motion
    waits until the gyro has reached its stamp.
    """

    def __init__(
        self,
        noise: WheelGyroNoise,
        limits: MotionLimits,
        wheel_radius_m: float | None = None,
        wheel_base_m: float | None = None,
    ) -> None:
        self._noise, self._limits = noise, limits
        self._variances = noise.variances()
        self._wheels = None
        if wheel_radius_m is not None and wheel_base_m is not None:
            self._wheels = wheel_radius_m, wheel_base_m
        self._last_wheels: WheelTicks | None = None
        self._last_odometry: Odometry | None = None
        self._waiting: deque[tuple[int, float, float, float, float, float]] = deque()
        self._gyro_ns, self._gyro_rad = -1, 0.0
        self._gyro_used: float | None = None  # the gyro's angle where the last increment ended
        self._rows: list[tuple[float, float, float, float, float, float]] = []
        self._stamps: list[int] = []
        self._advanced = 0
        self.total_rows = 0  # increments so far: a mark to which `advance_to` can go later
        self._bias = np.array([0.0, noise.bias_radps**2])
        self._state = np.zeros(4)
        self._covariance = np.zeros((4, 4))
        self._path: list[Floats] = []
        self._path_stamps: list[int] = []
        self._begin_stretch()
        self.travelled_m = self.turned_rad = 0.0
        self.counters: Counter[str] = Counter()

    @property
    def is_known(self) -> bool:
        """Whether anything was heard of the motion yet."""
        return bool(self.counters["used.wheels"] or self.counters["used.odom"])

    def add_wheels(self, event: WheelTicks) -> None:
        """Take in wheel angles."""
        if self._wheels is None:
            self.counters["unused.wheels"] += 1
            return
        if not (math.isfinite(event.left_rad) and math.isfinite(event.right_rad)):
            self.counters["skipped.wheels.not_finite"] += 1
            return
        last, self._last_wheels = self._last_wheels, event
        self.counters["used.wheels"] += 1
        if last is None:
            self._add(event.stamp_ns, event.stamp_ns, 0.0, 0.0, 0.0, "wheels")
            return
        radius, base = self._wheels
        left, right = (event.left_rad - last.left_rad) * radius, (event.right_rad - last.right_rad) * radius
        turn = (right - left) / base
        chord = 0.5 * (left + right) * _sinc(0.5 * turn)
        self._add(event.stamp_ns, last.stamp_ns, chord, 0.0, turn, "wheels")

    def add_odometry(self, event: Odometry) -> None:
        """Take in a pose of the robot's own odometry."""
        if self._wheels is not None:
            self.counters["unused.odom"] += 1
            return
        if not (math.isfinite(event.x_m) and math.isfinite(event.y_m) and math.isfinite(event.yaw_rad)):
            self.counters["skipped.odom.not_finite"] += 1
            return
        last, self._last_odometry = self._last_odometry, event
        self.counters["used.odom"] += 1
        if last is None:
            self._add(event.stamp_ns, event.stamp_ns, 0.0, 0.0, 0.0, "odom")
            return
        turn = math.remainder(event.yaw_rad - last.yaw_rad, math.tau)
        middle = last.yaw_rad + 0.5 * turn
        dx, dy = event.x_m - last.x_m, event.y_m - last.y_m
        c, s = math.cos(middle), math.sin(middle)
        self._add(event.stamp_ns, last.stamp_ns, c * dx + s * dy, c * dy - s * dx, turn, "odom")

    def add_imu(self, event: Imu) -> None:
        """Take in a turn rate: the mean since the message before."""
        if not abs(event.wz_radps) < _FASTEST_GYRO_RADPS:  # NaN fails too
            self.counters["skipped.imu.absurd"] += 1
            return
        before_ns, stamp = self._gyro_ns, event.stamp_ns
        gap_s = (stamp - before_ns) * 1e-9
        if before_ns >= 0 and gap_s <= 0.0:
            self.counters["skipped.imu.steps_back"] += 1
            return
        self.counters["used.imu"] += 1
        self._gyro_ns = stamp
        if before_ns < 0 or gap_s > self._limits.gyro_gap_s:
            self.counters["imu.gaps"] += before_ns >= 0
            self._release(stamp)
            self._gyro_used = None
            return
        before_rad = self._gyro_rad
        self._gyro_rad += event.wz_radps * gap_s
        waiting = self._waiting
        while waiting and waiting[0][0] <= stamp:
            share = min(max((waiting[0][0] - before_ns) * 1e-9 / gap_s, 0.0), 1.0)
            self._emit(before_rad + share * (self._gyro_rad - before_rad))

    def advance_to(self, mark: int) -> None:
        """Run the filter up to a mark; a mark that is behind is passed already."""
        count = mark - self._advanced
        if count <= 0:
            return
        path = np.empty((count, 3))
        rows = np.array(self._rows[:count])
        kernel.advance(self._state, self._covariance, rows, self._variances, path)
        self._path.append(path)
        self._path_stamps += self._stamps[:count]
        del self._rows[:count], self._stamps[:count]
        self._advanced += count

    def flush(self) -> None:
        """Motion that still waits for the gyro is used without it."""
        self._release(None)

    def stretch(self) -> Stretch:
        """The motion since the last stop, as far as `advance_to` went."""
        path = np.concatenate([np.zeros((0, 3)), *self._path])
        pose = np.array([*self._state[:2], float(se2.wrap_angle(self._state[2]))])
        return Stretch(pose, self._covariance[:3, :3].copy(), np.array(self._path_stamps, np.int64), path)

    def stop(self) -> Stretch:
        """The motion since the last stop, and a new stop here."""
        done = self.stretch()
        self._bias = np.array([self._state[3], self._covariance[3, 3]])
        self._begin_stretch()
        return done

    def _begin_stretch(self) -> None:
        self._state[:] = 0.0, 0.0, 0.0, self._bias[0]
        self._covariance[:] = 0.0
        self._covariance[3, 3] = self._bias[1]
        self._path.clear()
        self._path_stamps.clear()

    def _add(
        self, stamp_ns: int, before_ns: int, forward: float, sideways: float, turn: float, stream: str
    ) -> None:
        """An increment between two messages; one that no robot can do is a lost one."""
        seconds = max((stamp_ns - before_ns) * 1e-9, 0.0)
        limits, way, lost = self._limits, math.hypot(forward, sideways), 0.0
        if (
            way > limits.tolerance_m + limits.max_speed_mps * seconds
            or abs(turn) > limits.tolerance_rad + limits.max_turn_radps * seconds
        ):
            self.counters[f"{stream}.jumps"] += 1
            forward = sideways = turn = 0.0
            lost = 1.0
        self.travelled_m += way
        self.turned_rad += abs(turn)
        self._waiting.append((stamp_ns, forward, sideways, turn, seconds, lost))
        silent_s = (stamp_ns - self._gyro_ns) * 1e-9
        if self._gyro_ns < 0 or silent_s > self._limits.gyro_gap_s:
            self._release(None)
            self._gyro_used = None

    def _release(self, until_ns: int | None) -> None:
        """Let increments go without the gyro, those up to a stamp if one is given."""
        while self._waiting and (until_ns is None or self._waiting[0][0] <= until_ns):
            self._emit(None)

    def _emit(self, gyro_rad: float | None) -> None:
        stamp_ns, forward, sideways, turn, seconds, lost = self._waiting.popleft()
        turned = _NO_GYRO
        if gyro_rad is not None and self._gyro_used is not None:
            turned = gyro_rad - self._gyro_used
        self._gyro_used = gyro_rad
        self._rows.append((forward, sideways, turn, seconds, turned, lost))
        self._stamps.append(stamp_ns)
        self.total_rows += 1


def _sinc(half_turn: float) -> float:
    """Chord of an arc by its length."""
    return math.sin(half_turn) / half_turn if half_turn else 1.0
