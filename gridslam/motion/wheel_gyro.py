"""Odometry from wheel encoders and a gyro (ir-scan, paper section 2.6): increments of the wheels, yaw mostly from the gyro.

The filter runs from one stop to the next and returns the relative pose with its covariance; only the gyro's bias is carried
over. So a correction of a stop by the map does not enter the filter.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Imu, Odometry, WheelTicks
from gridslam.kernels import wheel_gyro as kernel
from gridslam.kernels.wheel_gyro import WheelGyroVariances, WheelIncrements
from gridslam.motion.odometry_limits import OdometryLimits

Floats = NDArray[np.float64]

MAX_GYRO_RADPS = 100.0
_NO_GYRO = math.nan


@dataclass(frozen=True, slots=True)
class WheelGyroNoise:
    """Standard deviations after one metre, radian or second; they grow with the root of distance, rotation or time.

    `gyro_scale` is the relative error of the gyro's yaw, `lost_m` and `lost_rad` belong to an increment that was lost.
    """

    forward_per_root_m: float = 0.012
    lateral_per_root_m: float = 0.003
    yaw_per_root_m: float = 0.06
    yaw_per_root_rad: float = 0.03
    yaw_per_root_s: float = 1e-5  # of a robot that stands
    gyro_per_root_s: float = 0.001
    gyro_scale: float = 0.003
    bias_radps: float = 0.02
    bias_per_root_s: float = 1e-4
    lost_m: float = 0.3
    lost_rad: float = 0.3

    def variances(self) -> WheelGyroVariances:
        """The squares of the standard deviations."""
        return WheelGyroVariances(
            forward_per_m=self.forward_per_root_m * self.forward_per_root_m,
            lateral_per_m=self.lateral_per_root_m * self.lateral_per_root_m,
            yaw_per_m=self.yaw_per_root_m * self.yaw_per_root_m,
            yaw_per_rad=self.yaw_per_root_rad * self.yaw_per_root_rad,
            yaw_per_s=self.yaw_per_root_s * self.yaw_per_root_s,
            gyro_per_s=self.gyro_per_root_s * self.gyro_per_root_s,
            gyro_scale=self.gyro_scale * self.gyro_scale,
            bias_per_s=self.bias_per_root_s * self.bias_per_root_s,
            lost_position=self.lost_m * self.lost_m,
            lost_yaw=self.lost_rad * self.lost_rad,
        )


@dataclass(frozen=True, slots=True)
class MotionLimits(OdometryLimits):
    """Motion beyond these limits is a jump of the encoders; a longer silence of the gyro is a gap."""

    max_speed_mps: float = 3.0
    max_yaw_rate_radps: float = 10.0
    tolerance_m: float = 0.1
    tolerance_rad: float = 0.3
    max_gyro_gap_s: float = 0.25


@dataclass(frozen=True, slots=True)
class RelativeMotion:
    """Motion since the last stop: T_stop_now `(3,)`, its covariance `(3, 3)`, and the poses `(n, 3)` with their stamps."""

    T_stop_now: Floats
    covariance: Floats
    stamps_ns: NDArray[np.int64]
    path: Floats


class _Increment(NamedTuple):
    """Motion between two messages, before the gyro's part is known; see `WheelIncrements`."""

    stamp_ns: int
    seconds: float
    forward_m: float = 0.0
    lateral_m: float = 0.0
    yaw_rad: float = 0.0
    is_lost: float = 0.0


class WheelGyro:
    """Collects messages; `advance_to` runs the filter over them.

    With `wheel_radius_m` and `wheel_base_m` wheel angles are used and odometry is ignored, else odometry is used. Motion is
    buffered until the gyro has reached its stamp.
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
        self._waiting: deque[_Increment] = deque()
        self._gyro_ns, self._gyro_rad = -1, 0.0
        self._gyro_used: float | None = None  # the gyro's angle at the end of the last increment
        self._rows: list[tuple[float, ...]] = []  # in the order of WheelIncrements
        self._stamps: list[int] = []
        self._advanced = 0
        self.total_rows = 0  # increments so far: a mark for a later `advance_to`
        self._bias = np.array([0.0, noise.bias_radps**2])
        self._state = np.zeros(4)
        self._covariance = np.zeros((4, 4))
        self._path: list[Floats] = []
        self._path_stamps: list[int] = []
        self._restart()
        self.travelled_m = self.rotated_rad = 0.0
        self.counters: Counter[str] = Counter()

    @property
    def is_known(self) -> bool:
        """Whether any wheel angles or odometry have been used."""
        return bool(self.counters["used.wheels"] or self.counters["used.odom"])

    def add_wheels(self, event: WheelTicks) -> None:
        """Add wheel angles."""
        if self._wheels is None:
            self.counters["unused.wheels"] += 1
            return
        if not (math.isfinite(event.left_rad) and math.isfinite(event.right_rad)):
            self.counters["skipped.wheels.not_finite"] += 1
            return
        last, self._last_wheels = self._last_wheels, event
        self.counters["used.wheels"] += 1
        if last is None:
            self._start(event.stamp_ns, "wheels")
            return
        radius, base = self._wheels
        left, right = (event.left_rad - last.left_rad) * radius, (event.right_rad - last.right_rad) * radius
        yaw = (right - left) / base
        chord = 0.5 * (left + right) * _sinc(0.5 * yaw)
        seconds = max((event.stamp_ns - last.stamp_ns) * 1e-9, 0.0)
        self._add(_Increment(event.stamp_ns, seconds, chord, yaw_rad=yaw), "wheels")

    def add_odometry(self, event: Odometry) -> None:
        """Add a pose of the robot's own odometry."""
        if self._wheels is not None:
            self.counters["unused.odom"] += 1
            return
        if not (math.isfinite(event.x_m) and math.isfinite(event.y_m) and math.isfinite(event.yaw_rad)):
            self.counters["skipped.odom.not_finite"] += 1
            return
        last, self._last_odometry = self._last_odometry, event
        self.counters["used.odom"] += 1
        if last is None:
            self._start(event.stamp_ns, "odom")
            return
        yaw = math.remainder(event.yaw_rad - last.yaw_rad, math.tau)
        middle = last.yaw_rad + 0.5 * yaw
        dx, dy = event.x_m - last.x_m, event.y_m - last.y_m
        c, s = math.cos(middle), math.sin(middle)
        seconds = max((event.stamp_ns - last.stamp_ns) * 1e-9, 0.0)
        self._add(_Increment(event.stamp_ns, seconds, c * dx + s * dy, c * dy - s * dx, yaw), "odom")

    def add_imu(self, event: Imu) -> None:
        """Add a yaw rate, the mean since the message before."""
        if not abs(event.wz_radps) < MAX_GYRO_RADPS:  # NaN fails too
            self.counters["skipped.imu.absurd"] += 1
            return
        last_ns, stamp = self._gyro_ns, event.stamp_ns
        gap_s = (stamp - last_ns) * 1e-9
        if last_ns >= 0 and gap_s <= 0.0:
            self.counters["skipped.imu.out_of_order"] += 1
            return
        self.counters["used.imu"] += 1
        self._gyro_ns = stamp
        if last_ns < 0 or gap_s > self._limits.max_gyro_gap_s:
            self.counters["imu.gaps"] += last_ns >= 0
            self._release(stamp)
            self._gyro_used = None
            return
        last_rad = self._gyro_rad
        self._gyro_rad += event.wz_radps * gap_s
        waiting = self._waiting
        while waiting and waiting[0].stamp_ns <= stamp:
            fraction = min(max((waiting[0].stamp_ns - last_ns) * 1e-9 / gap_s, 0.0), 1.0)
            self._emit(last_rad + fraction * (self._gyro_rad - last_rad))

    def advance_to(self, mark: int) -> None:
        """Run the filter up to a mark; without effect if it has passed the mark already."""
        count = mark - self._advanced
        if count <= 0:
            return
        path = np.empty((count, 3))
        columns = np.ascontiguousarray(np.array(self._rows[:count]).T)
        kernel.advance(self._state, self._covariance, WheelIncrements(*columns), self._variances, path)
        self._path.append(path)
        self._path_stamps += self._stamps[:count]
        del self._rows[:count], self._stamps[:count]
        self._advanced += count

    def flush(self) -> None:
        """Use the motion that still waits for the gyro without it."""
        self._release(None)

    def motion(self) -> RelativeMotion:
        """The motion since the last stop, up to where `advance_to` has run."""
        path = np.concatenate([np.zeros((0, 3)), *self._path])
        pose = np.array([*self._state[:2], float(se2.wrap_angle(self._state[2]))])
        return RelativeMotion(
            pose, self._covariance[:3, :3].copy(), np.array(self._path_stamps, np.int64), path
        )

    def stop(self) -> RelativeMotion:
        """The motion since the last stop; a new stop starts here."""
        motion = self.motion()
        self._bias = np.array([self._state[3], self._covariance[3, 3]])
        self._restart()
        return motion

    def _restart(self) -> None:
        self._state[:] = 0.0, 0.0, 0.0, self._bias[0]
        self._covariance[:] = 0.0
        self._covariance[3, 3] = self._bias[1]
        self._path.clear()
        self._path_stamps.clear()

    def _start(self, stamp_ns: int, stream: str) -> None:
        """An increment without motion at the first message of a stream."""
        self._add(_Increment(stamp_ns, 0.0), stream)

    def _add(self, increment: _Increment, stream: str) -> None:
        """Buffer an increment between two messages; one beyond the limits is lost."""
        distance = math.hypot(increment.forward_m, increment.lateral_m)
        if self._limits.has_jumped(distance, increment.yaw_rad, increment.seconds):
            self.counters[f"{stream}.jumps"] += 1
            increment = _Increment(increment.stamp_ns, increment.seconds, is_lost=1.0)
        self.travelled_m += distance
        self.rotated_rad += abs(increment.yaw_rad)
        self._waiting.append(increment)
        silence_s = (increment.stamp_ns - self._gyro_ns) * 1e-9
        if self._gyro_ns < 0 or silence_s > self._limits.max_gyro_gap_s:
            self._release(None)
            self._gyro_used = None

    def _release(self, until_ns: int | None) -> None:
        """Use buffered increments without the gyro, up to a stamp if one is given."""
        while self._waiting and (until_ns is None or self._waiting[0].stamp_ns <= until_ns):
            self._emit(None)

    def _emit(self, gyro_rad: float | None) -> None:
        """Hand the first buffered increment to the filter; `gyro_rad` is the gyro's angle at its end."""
        stamp_ns, seconds, forward, lateral, yaw, is_lost = self._waiting.popleft()
        gyro_step = _NO_GYRO
        if gyro_rad is not None and self._gyro_used is not None:
            gyro_step = gyro_rad - self._gyro_used
        self._gyro_used = gyro_rad
        self._rows.append((forward, lateral, yaw, seconds, gyro_step, is_lost))
        self._stamps.append(stamp_ns)
        self.total_rows += 1


def _sinc(half_angle: float) -> float:
    """Ratio of an arc's chord to its length, for half the angle (rad) of the arc."""
    return math.sin(half_angle) / half_angle if half_angle else 1.0
