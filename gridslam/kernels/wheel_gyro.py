"""The extended Kalman filter of wheel encoders and gyro, over many increments of motion in one call."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_square

Floats = NDArray[np.float64]


class WheelIncrements(NamedTuple):
    """Motion between consecutive messages, all `(n,)`.

    `forward_m` and `lateral_m` are seen at the middle heading; `yaw_rad` is that of the wheels, `seconds` the time between the
    messages, `gyro_rad` the angle that the gyro turned by (NaN: no gyro). `is_lost` is 1 where the encoders jumped, so that
    the motion is unknown, else 0.
    """

    forward_m: Floats
    lateral_m: Floats
    yaw_rad: Floats
    seconds: Floats
    gyro_rad: Floats
    is_lost: Floats


class WheelGyroVariances(NamedTuple):
    """Variances (m^2, rad^2) per metre, radian or second of motion, and those of a lost increment.

    `gyro_scale` is the square of the gyro's relative error.
    """

    forward_per_m: float
    lateral_per_m: float
    yaw_per_m: float
    yaw_per_rad: float
    yaw_per_s: float
    gyro_per_s: float
    gyro_scale: float
    bias_per_s: float
    lost_position: float
    lost_yaw: float


@compiled
def advance(
    state: Floats,
    covariance: Floats,
    increments: WheelIncrements,
    variances: WheelGyroVariances,
    poses: Floats,
) -> None:
    """Predict x, y, yaw and gyro bias over n increments.

    `state` `(4,)` and `covariance` `(4, 4)` are changed in place; `poses` `(n, 3)` receives the pose after each increment. The
    true yaw e of an increment is a fifth state with the wheels' yaw as its prior; the gyro measures e + bias * seconds.
    """
    x = np.zeros(5)
    P = np.zeros((5, 5))
    F = np.eye(5)
    for k in range(poses.shape[0]):
        forward, lateral, yaw = increments.forward_m[k], increments.lateral_m[k], increments.yaw_rad[k]
        seconds, gyro, lost = increments.seconds[k], increments.gyro_rad[k], increments.is_lost[k]
        distance = np.hypot(forward, lateral)
        x[:4] = state
        x[4] = yaw
        copy_square(P, covariance, 4)
        P[4, :] = 0.0
        P[:, 4] = 0.0
        P[3, 3] += variances.bias_per_s * seconds
        P[4, 4] = (
            variances.yaw_per_m * distance + variances.yaw_per_rad * abs(yaw) + variances.yaw_per_s * seconds
        )
        P[4, 4] += variances.lost_yaw * lost
        if not np.isnan(gyro):
            _measure_yaw(x, P, gyro, seconds, variances)
        middle = x[2] + 0.5 * x[4]
        c, s = np.cos(middle), np.sin(middle)
        step_x, step_y = c * forward - s * lateral, s * forward + c * lateral
        F[0, 2], F[0, 4] = -step_y, -0.5 * step_y
        F[1, 2], F[1, 4] = step_x, 0.5 * step_x
        F[2, 4] = 1.0
        P = F @ P @ F.T
        along = variances.forward_per_m * distance + variances.lost_position * lost
        across = variances.lateral_per_m * distance + variances.lost_position * lost
        P[0, 0] += c * c * along + s * s * across
        P[1, 1] += s * s * along + c * c * across
        P[0, 1] += c * s * (along - across)
        P[1, 0] += c * s * (along - across)
        state[0], state[1] = x[0] + step_x, x[1] + step_y
        state[2], state[3] = x[2] + x[4], x[3]
        copy_square(covariance, P, 4)
        poses[k, 0], poses[k, 1], poses[k, 2] = state[0], state[1], state[2]


@compiled
def _measure_yaw(x: Floats, P: Floats, gyro: float, seconds: float, variances: WheelGyroVariances) -> None:
    """Kalman update of `x` `(5,)` and `P` `(5, 5)` with the angle (rad) that the gyro measured."""
    noise = variances.gyro_per_s * seconds + variances.gyro_scale * gyro * gyro
    column = P[:, 3] * seconds + P[:, 4]
    innovation_variance = column[3] * seconds + column[4] + noise
    if innovation_variance > 0.0:
        innovation = gyro - x[4] - x[3] * seconds
        for i in range(5):
            x[i] += column[i] / innovation_variance * innovation
        for i in range(5):
            for j in range(5):
                P[i, j] -= column[i] * column[j] / innovation_variance
