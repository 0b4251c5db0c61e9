"""The vertical by an IMU that measures accelerations and turn rates, but no orientation."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.logs.imu.readings import MAX_GAP_S, ImuReadings, OdometryReference

Floats = NDArray[np.float64]

# Over which the specific force is averaged; what the robot accelerates cancels out only over the longer one.
GRAVITY_WINDOW_S, GRAVITY_WINDOW_ALONE_S = 10.0, 20.0
BIAS_ROUNDS = 3  # rounds in which the rates' error is estimated: the frame by the first rates is not still


def vertical_by_gravity(
    readings: ImuReadings, forces: Floats, R_base_imu: Floats, odometry: OdometryReference | None
) -> Floats:
    """The vertical `(n, 3)` in the sensor's frame: the specific force averaged in a frame that the turn rates keep still.

    `forces` `(n, 3)` are in m/s^2. What the robot accelerates by odometry is taken off before, where that makes the average
    steadier.
    """
    speeds = np.zeros(len(forces))
    found = [_averaged_in_still_frame(readings, forces, np.outer(speeds, R_base_imu[0]))]
    if odometry is not None and len(odometry.yaws) > 1:
        speeds = odometry.speeds_at(readings.stamps_ns)
        found.append(_averaged_in_still_frame(readings, forces, np.outer(speeds, R_base_imu[0])))
    still, mean = min(found, key=lambda one: _unsteadiness(one[1]))
    up = np.einsum("nji,nj->ni", still, mean)
    return np.asarray(up / np.maximum(np.linalg.norm(up, axis=1), 1e-9)[:, None])


def _averaged_in_still_frame(
    readings: ImuReadings, forces: Floats, velocities: Floats
) -> tuple[Floats, Floats]:
    """Rotations `(n, 3, 3)` into a frame that the turn rates keep still, and in it the forces `(n, 3)` on average, less what
    changes the velocities `(n, 3)`, both in the sensor's frame.
    """
    times = (readings.stamps_ns - readings.stamps_ns[0]) * 1e-9
    steps_s = np.diff(times, prepend=times[0])
    rates, turned = readings.rates, forces
    for _ in range(BIAS_ROUNDS):
        still = _integrated(rates, steps_s)
        turned = np.einsum("nij,nj->ni", still, forces)
        if velocities.any():
            turned = turned - np.gradient(np.einsum("nij,nj->ni", still, velocities), times, axis=0)
        rates = rates - _bias(still, steps_s, turned)
    return still, _averaged(turned, times, GRAVITY_WINDOW_S if velocities.any() else GRAVITY_WINDOW_ALONE_S)


def _bias(still: Floats, steps_s: Floats, forces: Floats) -> Floats:
    """The constant error `(3,)` (rad/s) of turn rates, given the rotations `(n, 3, 3)` by them and forces `(n, 3)` so turned.

    With it the frame that should be still turns, and gravity in it: by b x g in a second. Least squares over all readings, in
    which accelerations cancel out. An error about the sensor's mean vertical hardly shows, and counts as none.
    """
    gravity = forces.mean(axis=0)
    upward = np.einsum("nji,nj->i", still, forces)
    # Two directions (3, 2) across the vertical, in the sensor's frame, and what constant rates about these have become.
    across = np.linalg.svd(upward[None])[2][1:].T
    turned = np.cumsum(still * steps_s[:, None, None], axis=0) @ across
    x, y, z = gravity.tolist()
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    columns = np.concatenate([np.broadcast_to(np.eye(3), still.shape), -cross @ turned], axis=2)
    columns = columns.reshape(-1, 5)
    found, *_ = np.linalg.lstsq(columns.T @ columns, columns.T @ forces.ravel(), rcond=None)
    return np.asarray(across @ found[3:])


def _unsteadiness(forces: Floats) -> float:
    """Mean distance (m/s^2) of averaged specific forces `(n, 3)` in a fixed frame from their mean; 0 for gravity alone."""
    return float(np.linalg.norm(forces - forces.mean(axis=0), axis=1).mean())


def _averaged(forces: Floats, times: Floats, window_s: float) -> Floats:
    """Forces `(n, 3)` averaged over a window around each time, twice: what is near in time counts more."""
    first = np.searchsorted(times, times - 0.5 * window_s)
    after = np.searchsorted(times, times + 0.5 * window_s, side="right")
    mean = forces
    for _ in range(2):
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(mean, axis=0)])
        mean = (sums[after] - sums[first]) / (after - first)[:, None]
    return mean


def _integrated(rates: Floats, steps_s: Floats) -> Floats:
    """Rotations `(n, 3, 3)` of the sensor since the first reading, by its turn rates `(n, 3)` over the steps `(n,)`."""
    from scipy.spatial.transform import Rotation

    quats = np.empty((len(rates), 4))  # x, y, z, w
    w, x, y, z = 1.0, 0.0, 0.0, 0.0
    half_rotations = (0.5 * rates * np.minimum(steps_s, MAX_GAP_S)[:, None]).tolist()
    for k, (a, b, c) in enumerate(half_rotations):
        w, x, y, z = (
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
        )
        size = math.sqrt(w * w + x * x + y * y + z * z)
        w, x, y, z = w / size, x / size, y / size, z / size
        quats[k] = x, y, z, w
    return np.asarray(Rotation.from_quat(quats).as_matrix())
