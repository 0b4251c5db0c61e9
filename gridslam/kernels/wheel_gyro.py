"""The extended Kalman filter of encoders and gyro, over many increments of motion at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

FORWARD, SIDEWAYS, TURN, SECONDS, GYRO, LOST = range(6)  # columns of the increments


@compiled
def advance(
    state: NDArray[np.float64],
    covariance: NDArray[np.float64],
    increments: NDArray[np.float64],
    variances: NDArray[np.float64],
    path: NDArray[np.float64],
) -> None:
    """Move `state` (4,) = x, y, yaw, gyro bias and its covariance (4, 4) over increments `(n, 6)`; `path` `(n, 3)` is filled.

    An increment is forward and sideways way (m) seen at the middle heading, turn by the wheels (rad), seconds, angle that the
    gyro turned by in them (NaN: no gyro), and whether its motion was lost (1: the way is unknown). `variances`: forward per
    metre, sideways per metre, turn per metre, turn per radian, gyro per second, share of the turn that the gyro errs by, bias per
    second, way of a lost increment, turn of a lost increment, turn per second.

    The true turn e of the increment is a fifth state with the wheels' turn as its prior; the gyro measures e + bias * seconds.
    """
    x = np.zeros(5)
    P = np.zeros((5, 5))
    F = np.eye(5)
    for k in range(increments.shape[0]):
        forward, sideways, turn = increments[k, 0], increments[k, 1], increments[k, 2]
        seconds, gyro, lost = increments[k, 3], increments[k, 4], increments[k, 5]
        way = np.hypot(forward, sideways)
        x[:4] = state
        x[4] = turn
        P[:4, :4] = covariance
        P[4, :] = 0.0
        P[:, 4] = 0.0
        P[3, 3] += variances[6] * seconds
        P[4, 4] = variances[2] * way + variances[3] * abs(turn) + variances[9] * seconds
        P[4, 4] += variances[8] * lost
        if not np.isnan(gyro):
            noise = variances[4] * seconds + variances[5] * gyro * gyro
            column = P[:, 3] * seconds + P[:, 4]
            spread = column[3] * seconds + column[4] + noise
            if spread > 0.0:
                surprise = gyro - x[4] - x[3] * seconds
                for i in range(5):
                    x[i] += column[i] / spread * surprise
                for i in range(5):
                    for j in range(5):
                        P[i, j] -= column[i] * column[j] / spread
        middle = x[2] + 0.5 * x[4]
        c, s = np.cos(middle), np.sin(middle)
        step_x, step_y = c * forward - s * sideways, s * forward + c * sideways
        F[0, 2], F[0, 4] = -step_y, -0.5 * step_y
        F[1, 2], F[1, 4] = step_x, 0.5 * step_x
        F[2, 4] = 1.0
        P[:, :] = F @ P @ F.T
        along = variances[0] * way + variances[7] * lost
        across = variances[1] * way + variances[7] * lost
        P[0, 0] += c * c * along + s * s * across
        P[1, 1] += s * s * along + c * c * across
        P[0, 1] += c * s * (along - across)
        P[1, 0] += c * s * (along - across)
        state[0], state[1] = x[0] + step_x, x[1] + step_y
        state[2], state[3] = x[2] + x[4], x[3]
        covariance[:, :] = P[:4, :4]
        path[k, 0], path[k, 1], path[k, 2] = state[0], state[1], state[2]
