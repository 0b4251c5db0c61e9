"""Lag of an IMU's stamps behind the odometry's, found by correlating the yaw rates of both."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.logs.imu.readings import ImuReadings, OdometryReference

Floats = NDArray[np.float64]

LAGS_S: Floats = np.arange(-50, 51, dtype=np.float64) * 0.01
STEP_S = 0.1  # duration over which rotations are compared
MIN_LAG_S = 0.03  # a robot that sways tilts by less than it matters in a shorter time
MIN_CORRELATION = 0.9  # smallest correlation of the rotations with the lag
MIN_GAIN = 1.5  # what is missing to a correlation of 1 without the lag, by what is missing with it
MIN_ROTATION_RAD = 1.0  # smallest rotation of the odometry


def imu_lag_s(readings: ImuReadings, R_base_imu: Floats, odometry: OdometryReference | None) -> float:
    """Seconds by which the IMU is later than the odometry, negative where it is earlier; 0 without clear evidence.

    `R_base_imu` `(3, 3)` turns from the sensor's frame into the base frame.
    """
    if odometry is None or len(odometry.yaws) < 2:
        return 0.0
    origin_ns = int(readings.stamps_ns[0])
    times, own = ((stamps - origin_ns) * 1e-9 for stamps in (readings.stamps_ns, odometry.stamps_ns))
    rates = readings.rates @ R_base_imu[2]
    heading = np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(times))])
    grid = np.arange(max(times[0], own[0]) - LAGS_S[0], min(times[-1], own[-1]) - LAGS_S[-1], STEP_S)
    if len(grid) < 3:
        return 0.0
    turned = np.diff(np.interp(grid, own, np.unwrap(odometry.yaws)))
    if np.abs(turned).sum() < MIN_ROTATION_RAD:
        return 0.0
    found = np.array(
        [abs(_correlation(np.diff(np.interp(grid + lag, times, heading)), turned)) for lag in LAGS_S]
    )
    best = int(found.argmax())
    lag_s = float(LAGS_S[best])
    gain = (1.0 - found[len(LAGS_S) // 2]) / max(1.0 - found[best], 1e-9)
    is_clear = abs(lag_s) >= MIN_LAG_S and found[best] >= MIN_CORRELATION and gain >= MIN_GAIN
    return lag_s if is_clear else 0.0


def _correlation(a: Floats, b: Floats) -> float:
    size = math.sqrt(float((a**2).sum() * (b**2).sum()))
    return float((a * b).sum()) / size if size > 0.0 else 0.0
