"""The filter of encoders and gyro as textbook equations, one increment at a time: predict the yaw, measure it, move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.wheel_gyro import WheelGyroVariances, WheelIncrements

Floats = NDArray[np.float64]


def step(
    x: Floats, P: Floats, increments: WheelIncrements, k: int, v: WheelGyroVariances
) -> tuple[Floats, Floats]:
    """State (x, y, yaw, bias) and covariance after increment k."""
    forward, lateral, yaw, seconds, gyro, lost = (values[k] for values in increments)
    distance = np.hypot(forward, lateral)
    state = np.append(x, yaw)
    cov = np.zeros((5, 5))
    cov[:4, :4] = P
    cov[3, 3] += v.bias_per_s * seconds
    cov[4, 4] = v.yaw_per_m * distance + v.yaw_per_rad * abs(yaw) + v.yaw_per_s * seconds + v.lost_yaw * lost
    if not np.isnan(gyro):
        H = np.array([[0.0, 0.0, 0.0, seconds, 1.0]])
        S = (H @ cov @ H.T).item() + v.gyro_per_s * seconds + v.gyro_scale * gyro**2
        K = (cov @ H.T / S)[:, 0]
        state = state + K * (gyro - (H @ state).item())
        cov = (np.eye(5) - np.outer(K, H)) @ cov
    moved = motion(state, forward, lateral)
    F = np.column_stack(
        [
            (motion(state + d, forward, lateral) - motion(state - d, forward, lateral)) / 2e-6
            for d in 1e-6 * np.eye(5)
        ]
    )
    middle = state[2] + 0.5 * state[4]
    R = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    out = F @ cov @ F.T
    out[:2, :2] += (
        R
        @ np.diag(
            [
                v.forward_per_m * distance + v.lost_position * lost,
                v.lateral_per_m * distance + v.lost_position * lost,
            ]
        )
        @ R.T
    )
    return moved, out


def motion(state: Floats, forward: float, lateral: float) -> Floats:
    """x, y, yaw, bias after a motion with the yaw step e of a state (x, y, yaw, bias, e)."""
    x, y, yaw, bias, e = state
    c, s = np.cos(yaw + 0.5 * e), np.sin(yaw + 0.5 * e)
    return np.array([x + c * forward - s * lateral, y + s * forward + c * lateral, yaw + e, bias])
