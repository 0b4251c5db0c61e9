"""Finds gyros with wrong axes, sign, unit or clock by comparing their rates with the rotations of scan matching."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import Event, Imu, Transform
from gridslam.core.stamps import earlier_stamp
from gridslam.core.trajectory import Trajectory, time_windows

Floats = NDArray[np.float64]

WINDOW_S = 1.0  # duration of the windows whose rotations are compared
LAGS_S: Floats = np.arange(-50, 52, 2, dtype=np.float64) * 0.01
MIN_LAG_S = 0.05  # smallest lag that is corrected: a shorter one rotates a scan by less than its noise
MIN_ROTATION_RAD, MIN_WINDOWS = 2.0, 30  # smallest sum of the matched rotations, and number of windows
NOISE_RAD = 0.01  # noise of the matched rotation of a window
MAX_ERROR_RATIO = 0.5  # largest ratio of the mean difference after the correction to that before
MAX_ERROR = 0.2  # largest mean difference after the correction, relative to the mean rotation
SAME_UNIT = 0.15  # largest relative difference of two factors of one unit
PURE_AXIS = 0.97  # cosine of the largest angle between the upward direction and an axis of the sensor
IN_BASE = ""  # frame of turn rates about the axes of the base: no extrinsics belong to it
MIN_FACTOR = 0.01  # smallest factor, and inverse of the largest, of a unit of turn rates; any other is chance
MAX_RATE = 1e6  # largest turn rate in any unit; beyond it a rate is damaged, and its square is more than a float holds
RAD_PER_DEG = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class GyroCorrection:
    """Yaw rate of the IMU `frame_id` = `factors` . (rates about x, y, z), measured `lag_s` before its stamps.

    `upward` `(3,)`: the upward direction in the IMU's frame by its extrinsics. `is_fault`: the scans contradict the log.
    """

    frame_id: str
    factors: tuple[float, float, float]
    upward: tuple[float, float, float] = (0.0, 0.0, 1.0)
    lag_s: float = 0.0
    is_fault: bool = True

    @property
    def is_reversed(self) -> bool:
        """Whether the yaw rate by the log is right but for its sign."""
        return self._cosine < -PURE_AXIS

    @property
    def _cosine(self) -> float:
        """Cosine of the angle between the upward directions by the scans and by the log."""
        return sum(f * u for f, u in zip(self.factors, self.upward, strict=True)) / math.hypot(*self.factors)

    @property
    def note(self) -> str:
        """One line for the user."""
        size = math.hypot(*self.factors)
        found = []
        if self.is_reversed:
            found.append("its yaw rate has the wrong sign, or the lidar hangs upside down")
        elif self._cosine < PURE_AXIS:
            axis = max(range(3), key=lambda k: abs(self.factors[k]))
            found.append(
                f"its axes are rotated: it points upward along {'-' * (self.factors[axis] < 0)}{'xyz'[axis]}"
            )
        if abs(size / RAD_PER_DEG - 1.0) < SAME_UNIT:
            found.append("its turn rates are in degrees a second")
        elif abs(size - 1.0) > SAME_UNIT:
            found.append(f"its turn rates are {1.0 / size:.2g} of the true ones")
        if self.lag_s:
            found.append(f"it is {abs(self.lag_s):.2f} s {'late' if self.lag_s > 0.0 else 'early'}")
        return f"the IMU {self.frame_id} contradicts the scans: {', '.join(found)}; used corrected"

    def applied_to(self, imu: Imu) -> Imu:
        """A reading of the IMU with the yaw rate about the robot's z axis; readings of other IMUs unchanged."""
        if imu.frame_id != self.frame_id:
            return imu
        x, y, z = self.factors
        rate = x * imu.wx_radps + y * imu.wy_radps + z * imu.wz_radps
        stamp_ns = earlier_stamp(imu.stamp_ns, self.lag_s)
        return replace(imu, stamp_ns=stamp_ns, frame_id=IN_BASE, wz_radps=rate)


def find_gyro_correction(events: Sequence[Event], track: Trajectory) -> GyroCorrection | None:
    """Correction of the yaw rates of the only IMU among the events, given the path by matching; None if they are right."""
    imus = [e for e in events if isinstance(e, Imu)]
    frames = {imu.frame_id for imu in imus}
    if len(frames) != 1 or len(imus) < MIN_WINDOWS:
        return None
    upward = _upward(events, imus[0].frame_id)
    by_log = GyroCorrection(imus[0].frame_id, _triple(upward), _triple(upward), is_fault=False)
    fallback = None if abs(upward[2]) > PURE_AXIS else by_log
    windows = _windows(track)
    if windows is None:
        return fallback
    starts, ends, matched = windows
    gyro = _Rotations(imus, track.stamps_ns[starts], track.stamps_ns[ends])
    error_by_log = _error(gyro.at(0.0) @ upward, 1.0, matched)
    candidates = [_best_axis(gyro.at(float(lag)), matched) for lag in LAGS_S]
    best = min(range(len(candidates)), key=lambda k: candidates[k][0])
    lag_s = float(LAGS_S[best])
    if abs(lag_s) < MIN_LAG_S:
        lag_s = 0.0
    error, factors = _best_axis(gyro.at(lag_s), matched)
    is_clear = error + NOISE_RAD < MAX_ERROR_RATIO * (error_by_log + NOISE_RAD)
    if not is_clear or error > MAX_ERROR * float(np.abs(matched).mean()):
        return fallback
    return replace(by_log, factors=_triple(_in_usual_unit(factors)), lag_s=lag_s, is_fault=True)


def points_down(events: Sequence[Event]) -> bool:
    """Whether the only IMU hangs upside down by its accelerations, against its extrinsics; its turn rates are then reversed."""
    imus = [e for e in events if isinstance(e, Imu)]
    forces = np.array([imu.accel_mps2 for imu in imus if imu.accel_mps2 is not None])
    return len(forces) > 0 and float(np.nanmedian(forces @ _upward(events, imus[0].frame_id))) < 0.0


def is_gyro_with_scans(events: Sequence[Event], track: Trajectory) -> bool:
    """Whether the yaw rates of the only IMU, with the extrinsics of the log, certainly are those of the path by matching."""
    imus = [e for e in events if isinstance(e, Imu)]
    windows = _windows(track)
    if windows is None or len({imu.frame_id for imu in imus}) != 1 or len(imus) < MIN_WINDOWS:
        return False
    starts, ends, matched = windows
    rotations = _Rotations(imus, track.stamps_ns[starts], track.stamps_ns[ends]).at(0.0)
    error = _error(rotations @ _upward(events, imus[0].frame_id), 1.0, matched)
    return error < MAX_ERROR * float(np.abs(matched).mean())


def _windows(track: Trajectory) -> tuple[NDArray[np.int64], NDArray[np.int64], Floats] | None:
    """Rows `(n,)` where windows of the path begin and end, its rotations `(n,)` (rad) in them; None if it turns too little."""
    starts, ends = time_windows(track.stamps_ns, WINDOW_S)
    turned = np.unwrap(track.poses[:, 2])
    matched = turned[ends] - turned[starts]
    if len(matched) < MIN_WINDOWS or np.abs(matched).sum() < MIN_ROTATION_RAD:
        return None
    return starts, ends, matched


class _Rotations:
    """Integrated turn rates of an IMU over windows."""

    def __init__(self, imus: Sequence[Imu], start_ns: NDArray[np.int64], end_ns: NDArray[np.int64]) -> None:
        stamps_ns = np.array([imu.stamp_ns for imu in imus], np.int64)
        rates = np.array([(imu.wx_radps, imu.wy_radps, imu.wz_radps) for imu in imus])
        rates = np.clip(rates, -MAX_RATE, MAX_RATE)
        order = np.argsort(stamps_ns, kind="stable")
        origin_ns = int(start_ns[0])
        self._times_s = (stamps_ns[order] - origin_ns) * 1e-9
        rates = rates[order]
        steps = 0.5 * (rates[1:] + rates[:-1]) * np.diff(self._times_s)[:, None]
        self._turned = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        self._start_s, self._end_s = (start_ns - origin_ns) * 1e-9, (end_ns - origin_ns) * 1e-9

    def at(self, lag_s: float) -> Floats:
        """Turns `(n, 3)` about the sensor's axes, recorded `lag_s` after the windows."""
        return np.column_stack(
            [
                np.interp(self._end_s + lag_s, self._times_s, column)
                - np.interp(self._start_s + lag_s, self._times_s, column)
                for column in self._turned.T
            ]
        )


def _error(rotations: Floats, factor: float, matched: Floats) -> float:
    """Mean difference (rad) of rotations `(n,)` times a factor from matched ones `(n,)`, without a bias."""
    difference = matched - factor * rotations
    return float(np.abs(difference - np.median(difference)).mean())


def _best_axis(rotations: Floats, matched: Floats) -> tuple[float, Floats]:
    """The sensor axis whose rotations agree best with the matched ones `(n,)`: mean difference (rad), and factors `(3,)`.

    `rotations` `(n, 3)` are those about the three axes. The factors of the two other axes are 0.
    """
    found = []
    for axis in range(3):
        centred, wanted = rotations[:, axis] - rotations[:, axis].mean(), matched - matched.mean()
        square = float(centred @ centred)
        factor = float(centred @ wanted) / square if square > 0.0 else 0.0
        if MIN_FACTOR < abs(factor) < 1.0 / MIN_FACTOR:
            found.append((_error(rotations[:, axis], factor, matched), tuple(factor * np.eye(3)[axis])))
    if not found:
        return math.inf, np.zeros(3)
    error, factors = min(found)
    return error, np.array(factors)


def _upward(events: Sequence[Event], frame_id: str) -> Floats:
    """The unit vector upward `(3,)` in an IMU's frame by its extrinsics; the z axis if it has none."""
    for event in events:
        if isinstance(event, Transform) and event.is_static and event.child_frame_id == frame_id:
            return np.asarray(rotation_matrix(event.quat_wxyz)[2])
    return np.array([0.0, 0.0, 1.0])


def _in_usual_unit(factors: Floats) -> Floats:
    """The factors `(3,)`, rescaled to exactly rad/s or deg/s if they are close to one of them."""
    size = float(np.linalg.norm(factors))
    unit = next((u for u in (1.0, RAD_PER_DEG) if abs(size / u - 1.0) < SAME_UNIT), size)
    return np.asarray(factors / size * unit)


def _triple(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
