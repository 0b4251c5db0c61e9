"""The lag of an IMU behind the odometry, by the turns of both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.logs.imu.lag import imu_lag_s
from gridslam.logs.imu.readings import ImuReadings, OdometryReference

S = 10**9
TIMES = np.arange(0.0, 40.0, 0.01)
YAW = 0.8 * np.sin(0.6 * TIMES) + 0.3 * np.sin(1.7 * TIMES)
ODOMETRY = OdometryReference((TIMES[::5] * S).astype(np.int64), YAW[::5], np.zeros((len(TIMES[::5]), 2)))


def imu(lag_s: float, seed: int = 0) -> ImuReadings:
    """Turn rates with noise and a bias, stamped late by a time."""
    noise = np.random.default_rng(seed).normal(0.002, 0.005, (len(TIMES), 3))
    rates = noise + np.column_stack([0.0 * TIMES, 0.0 * TIMES, np.gradient(YAW, TIMES)])
    nothing = np.full((len(TIMES), 4), np.nan)
    return ImuReadings(((TIMES + lag_s + 1.0) * S).astype(np.int64) - S, nothing, rates, nothing[:, :3])


@pytest.mark.parametrize("lag_s", [-0.2, 0.06, 0.1, 0.3])
def test_a_lag_is_found_in_either_direction(lag_s: float) -> None:
    assert imu_lag_s(imu(lag_s), np.eye(3), ODOMETRY) == pytest.approx(lag_s, abs=0.015)


@pytest.mark.parametrize("lag_s", [0.0, 0.02])
def test_a_lag_that_does_not_matter_is_none(lag_s: float) -> None:
    assert imu_lag_s(imu(lag_s), np.eye(3), ODOMETRY) == 0.0


def test_without_turns_or_odometry_or_with_other_turns_there_is_no_lag() -> None:
    still = replace(ODOMETRY, yaws=0.0 * ODOMETRY.yaws)
    other = replace(ODOMETRY, yaws=np.random.default_rng(1).normal(0.0, 1.0, len(ODOMETRY.yaws)))
    assert [imu_lag_s(imu(0.2), np.eye(3), odometry) for odometry in (None, still, other)] == [0.0, 0.0, 0.0]
