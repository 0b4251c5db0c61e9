"""The encoder and gyro filter as textbook equations: predict the turn, measure it, then move (one increment at a time)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def step(x: Floats, P: Floats, increment: Floats, v: Floats) -> tuple[Floats, Floats]:
    """One increment: forward, sideways, turn, seconds, gyro angle (NaN: none), lost. State x, y, yaw, bias."""
    forward, sideways, turn, seconds, gyro, lost = increment
    way = np.hypot(forward, sideways)
    state = np.append(x, turn)
    cov = np.zeros((5, 5))
    cov[:4, :4] = P
    cov[3, 3] += v[6] * seconds
    cov[4, 4] = v[2] * way + v[3] * abs(turn) + v[9] * seconds + v[8] * lost
    if not np.isnan(gyro):
        H = np.array([[0.0, 0.0, 0.0, seconds, 1.0]])
        S = (H @ cov @ H.T).item() + v[4] * seconds + v[5] * gyro**2
        K = (cov @ H.T / S)[:, 0]
        state = state + K * (gyro - (H @ state).item())
        cov = (np.eye(5) - np.outer(K, H)) @ cov
    moved = motion(state, forward, sideways)
    F = np.column_stack(
        [
            (motion(state + d, forward, sideways) - motion(state - d, forward, sideways)) / 2e-6
            for d in 1e-6 * np.eye(5)
        ]
    )
    middle = state[2] + 0.5 * state[4]
    R = np.array([[np.cos(middle), -np.sin(middle)], [np.sin(middle), np.cos(middle)]])
    out = F @ cov @ F.T
    out[:2, :2] += R @ np.diag([v[0] * way + v[7] * lost, v[1] * way + v[7] * lost]) @ R.T
    return moved, out


def motion(state: Floats, forward: float, sideways: float) -> Floats:
    """x, y, yaw, bias after the turn e of a state (x, y, yaw, bias, e)."""
    x, y, yaw, bias, e = state
    c, s = np.cos(yaw + 0.5 * e), np.sin(yaw + 0.5 * e)
    return np.array([x + c * forward - s * sideways, y + s * forward + c * sideways, yaw + e, bias])
