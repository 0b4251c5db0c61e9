"""The vertical in the robot's frame over time, by an IMU whose orientation or accelerations can be trusted.

An orientation is compared with the IMU's own accelerations and turn rates, and the turn rate with that of the odometry. This
finds orientations that were never set, inverted quaternions, z axes that point down (NED) and boards mounted upside down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.logs.imu.gravity import vertical_by_gravity
from gridslam.logs.imu.readings import MAX_GAP_S, ImuReadings, OdometryReference, Stamps

Floats = NDArray[np.float64]

MIN_MEASURED = 0.9  # fraction of the readings from which an orientation or acceleration counts as measured
MAX_NORM_ERROR = 0.02  # largest error of a quaternion's length
GRAVITY_MPS2, MAX_GRAVITY_ERROR = 9.81, 0.1  # median specific force; a few drivers write it in g
# Mean cosine between the vertical by the orientation and that by the accelerations: robots accelerate little.
MIN_AGREEMENT = 0.9
# Smallest correlation of changes of the vertical with the turn rates that should cause them
MIN_RATE_CORRELATION = 0.5
RATE_STEP_S = 0.1  # duration over which these are compared
MIN_ROTATION_RAD = 1.0  # smallest rotation of the odometry that shows the sign of the IMU's yaw rate
YAW_STEP_S = 0.5
MAX_IMU_TILT_RAD = math.radians(15.0)  # largest tilt of the IMU on the robot beyond its known extrinsics
MAX_TILT_RAD = math.radians(35.0)  # a robot that maps a floor tilts less
# Tilts of 95 % of the readings below these change no scan by more than its noise, or are that of the estimate itself.
MIN_SWAY_RAD, MIN_SWAY_BY_GRAVITY_RAD = math.radians(0.6), math.radians(1.2)
UPSIDE_DOWN = "it is upside down, and no transform to the base says so"


@dataclass(frozen=True, slots=True)
class Verticals:
    """The unit vector upward `(n, 3)` in the robot's frame at `stamps_ns` `(n,)`, and how it was found, in words."""

    stamps_ns: Stamps
    up: Floats
    remarks: tuple[str, ...]
    by_gravity: bool

    @property
    def sway_rad(self) -> float:
        """The tilt that 95 % of the readings do not exceed."""
        return float(np.arccos(np.clip(np.percentile(self.up[:, 2], 5.0), -1.0, 1.0)))

    @property
    def is_level(self) -> bool:
        """Whether the robot tilts so little that scans need no levelling."""
        return self.sway_rad < (MIN_SWAY_BY_GRAVITY_RAD if self.by_gravity else MIN_SWAY_RAD)


class UntrustedImuError(Exception):
    """The IMU does not give the vertical; the message says why."""


def verticals_of(readings: ImuReadings, R_base_imu: Floats, odometry: OdometryReference | None) -> Verticals:
    """Verticals in the base frame: by the orientation, or by the specific force where no orientation can be trusted.

    `R_base_imu` `(3, 3)` rotates the IMU into the base frame. Raises UntrustedImuError: neither gives a vertical.
    """
    forces = _specific_forces(readings.forces)
    yaw_sense = _yaw_sense(readings, R_base_imu, odometry)
    remarks: list[str] = []
    try:
        up = _by_orientation(readings, forces)
        by_gravity = up is None
        if up is not None:
            up = _with_sense(up, forces, R_base_imu, yaw_sense, remarks)
    except UntrustedImuError as error:
        remarks.append(f"its orientation is not used: {error}")
        up, by_gravity = None, True
    if up is None:
        if forces is None or not readings.rates[:, :2].any():
            raise UntrustedImuError(remarks.pop() if remarks else "")
        up = vertical_by_gravity(readings, forces, R_base_imu, odometry)
        up = up * _gravity_sense(up, R_base_imu, yaw_sense)
    up = up @ R_base_imu.T
    if np.median(up[:, 2]) < 0.0:  # both axes of NED point down, and no extrinsics say so
        up = up * (1.0, -1.0, -1.0)
    return Verticals(readings.stamps_ns, _extrinsics_removed(up), tuple(remarks), by_gravity)


def _by_orientation(readings: ImuReadings, forces: Floats | None) -> Floats | None:
    """The vertical `(n, 3)` in the sensor's frame by its orientation; None if there is none, or it never changes."""
    quats = readings.quats
    measured = np.isfinite(quats).all(axis=1)
    if measured.mean() < MIN_MEASURED or np.ptp(quats[measured], axis=0).max() == 0.0:
        return None
    norms = np.linalg.norm(quats[measured], axis=1)
    if abs(float(np.median(norms)) - 1.0) > MAX_NORM_ERROR:
        raise UntrustedImuError(f"its quaternions have length {np.median(norms):.3g}, not 1")
    known = _up_of(quats[measured] / norms[:, None])
    up: Floats = known[np.maximum(np.cumsum(measured) - 1, 0)]  # where it is missing, as before
    _check_angular_rates(readings, up)
    return up


def _up_of(quats: Floats) -> Floats:
    """The vertical `(n, 3)` in frames whose orientations are unit quaternions `(n, 4)`."""
    w, x, y, z = quats.T
    return np.column_stack([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def _check_angular_rates(readings: ImuReadings, up: Floats) -> None:
    """Raises UntrustedImuError: changes of the vertical `(n, 3)` contradict the turn rates."""
    rates = readings.rates
    if not rates[:, :2].any():
        return
    times = (readings.stamps_ns - readings.stamps_ns[0]) * 1e-9
    after = np.searchsorted(times, times + RATE_STEP_S)
    first = np.flatnonzero(after < len(times))
    after = after[first]
    step_s = times[after] - times[first]
    used = step_s < MAX_GAP_S + RATE_STEP_S
    first, after, step_s = first[used], after[used], step_s[used]
    if len(first) < 10:
        return
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(rates - np.median(rates, axis=0), axis=0)])
    mean_rate = (sums[after] - sums[first]) / np.maximum(after - first, 1)[:, None]
    mean_rate[:, 2] += np.median(rates[:, 2])
    expected = -np.cross(mean_rate, up[first]) * step_s[:, None]
    changed = up[after] - up[first]
    scale = math.sqrt(float((expected**2).sum() * (changed**2).sum()))
    tilts = float(np.sqrt((changed**2).sum(axis=1).mean()))
    if tilts > 0.5 * MIN_SWAY_RAD and float((expected * changed).sum()) < MIN_RATE_CORRELATION * scale:
        raise UntrustedImuError("it contradicts the IMU's own turn rates")


def _specific_forces(forces: Floats) -> Floats | None:
    """The forces `(n, 3)` in m/s^2; None if they are missing or are not those of gravity."""
    measured = np.isfinite(forces).all(axis=1)
    if measured.mean() < MIN_MEASURED:
        return None
    found = forces.copy()
    found[~measured] = np.median(forces[measured], axis=0)
    size = float(np.median(np.linalg.norm(found, axis=1)))
    for unit in (GRAVITY_MPS2, 1.0):
        if abs(size / unit - 1.0) < MAX_GRAVITY_ERROR:
            return np.asarray(found * (GRAVITY_MPS2 / unit))
    return None


def _yaw_sense(readings: ImuReadings, R_base_imu: Floats, odometry: OdometryReference | None) -> int:
    """1 if the IMU turns as the odometry does, -1 if it turns the other way, 0 if neither is certain."""
    if odometry is None or len(odometry.yaws) < 2:
        return 0
    times = readings.stamps_ns * 1e-9
    rates = readings.rates @ R_base_imu[2]
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(times))])
    grid = np.arange(max(times[0], odometry.stamps_ns[0] * 1e-9), times[-1], YAW_STEP_S)
    grid = grid[grid <= odometry.stamps_ns[-1] * 1e-9]
    if len(grid) < 3:
        return 0
    ours = np.diff(np.interp(grid, times, heading))
    theirs = np.diff(np.interp(grid, odometry.stamps_ns * 1e-9, np.unwrap(odometry.yaws)))
    size = math.sqrt(float((ours**2).sum() * (theirs**2).sum()))
    if np.abs(theirs).sum() < MIN_ROTATION_RAD or size == 0.0:
        return 0
    correlation = float((ours * theirs).sum()) / size
    return 0 if abs(correlation) < MIN_RATE_CORRELATION else int(np.sign(correlation))


def _with_sense(
    up: Floats, forces: Floats | None, R_base_imu: Floats, yaw_sense: int, remarks: list[str]
) -> Floats:
    """The vertical `(n, 3)`, turned over where the orientation is that of NED. Raises UntrustedImuError."""
    points_up = float(np.median(up @ R_base_imu[2])) > 0.0
    if forces is not None:
        size = np.linalg.norm(forces, axis=1)
        agreement = float(np.mean((forces * up).sum(axis=1) / np.maximum(size, 1e-9)))
        if abs(agreement) < MIN_AGREEMENT:
            raise UntrustedImuError("it contradicts the IMU's own accelerations")
        is_ned = agreement < 0.0 and (not points_up or yaw_sense < 0)
        if agreement < 0.0 and not is_ned and yaw_sense == 0:
            raise UntrustedImuError(
                "its accelerations point the other way, so that it is NED or they are gravity"
            )
    else:
        is_ned = points_up and yaw_sense < 0
    if is_ned:
        remarks.append("its z axis points down (NED), which was undone")
        return -up
    if not points_up:
        raise UntrustedImuError(UPSIDE_DOWN)
    return up


def _gravity_sense(up: Floats, R_base_imu: Floats, yaw_sense: int) -> float:
    """-1.0 where the accelerations are gravity's instead of the force against it. Raises UntrustedImuError."""
    if float(np.median(up @ R_base_imu[2])) > 0.0:
        return 1.0
    if yaw_sense > 0:
        return -1.0
    raise UntrustedImuError(UPSIDE_DOWN)


def _extrinsics_removed(up: Floats) -> Floats:
    """The verticals `(n, 3)` without the constant tilt of the IMU on the robot. Raises UntrustedImuError."""
    middle = np.median(up, axis=0)
    middle /= max(float(np.linalg.norm(middle)), 1e-9)
    if middle[2] < math.cos(MAX_IMU_TILT_RAD):
        angle = math.degrees(math.acos(min(max(float(middle[2]), -1.0), 1.0)))
        raise UntrustedImuError(f"it is tilted by {angle:.0f} deg on the robot, and no transform says so")
    x, y, z = middle.tolist()
    # The smallest rotation that takes the middle to the vertical (Rodrigues).
    cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    levelled = up @ (np.eye(3) + cross + cross @ cross / (1.0 + z)).T
    if float(np.percentile(levelled[:, 2], 5.0)) < math.cos(MAX_TILT_RAD):
        raise UntrustedImuError(f"by it the robot tilts by more than {math.degrees(MAX_TILT_RAD):.0f} deg")
    return np.asarray(levelled)
