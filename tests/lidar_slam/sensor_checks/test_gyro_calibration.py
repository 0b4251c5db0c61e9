"""Gyros whose axes, sign, unit or clock are wrong are found by the turns of scan matching, and used corrected."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core.messages import Event, Imu, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks.gyro_calibration import (
    GyroCorrection,
    find_gyro_correction,
    is_gyro_with_scans,
    points_down,
)

NS = 10**9


def yaw(t: np.ndarray) -> np.ndarray:
    return np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)


def track() -> Trajectory:
    t = np.arange(0.0, 40.0, 0.1)
    return Trajectory((t * NS).astype(np.int64), np.column_stack([0.5 * t, 0.0 * t, yaw(t)]))


def readings(factors: tuple[float, float, float], lag_s: float = 0.0, bias: float = 0.02) -> list[Event]:
    """An IMU whose turn rates are the yaw rate times `factors`, with noise."""
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 40.0, 0.01)
    rates = np.gradient(yaw(t), t)[:, None] * np.array(factors) + rng.normal(bias, 0.01, (len(t), 3))
    stamps = ((t + lag_s) * NS).astype(np.int64).tolist()
    return [Imu(s, "imu", wz, wx, wy) for s, (wx, wy, wz) in zip(stamps, rates.tolist(), strict=True)]


CASES = {
    "degrees": ((0.0, 0.0, math.degrees(1.0)), 0.0, "its turn rates are in degrees a second"),
    "reversed": ((0.0, 0.0, -1.0), 0.0, "wrong sign, or the lidar hangs upside down"),
    "y_upward": ((0.0, 1.0, 0.0), 0.0, "it points upward along y"),
    "x_downward": ((-1.0, 0.0, 0.0), 0.0, "it points upward along -x"),
    "half": ((0.0, 0.0, 0.5), 0.0, "its turn rates are 0.5 of the true ones"),
    "late": ((0.0, 0.0, 1.0), 0.2, "it is 0.20 s late"),
}


@pytest.mark.parametrize(("factors", "lag_s", "says"), CASES.values(), ids=CASES)
def test_faults_are_named_and_undone(factors: tuple[float, float, float], lag_s: float, says: str) -> None:
    events = readings(factors, lag_s)
    found = find_gyro_correction(events, track())
    assert found is not None
    assert says in found.note
    assert found.lag_s == pytest.approx(lag_s, abs=0.021)
    right = readings((0.0, 0.0, 1.0))
    for given, expected in zip(events[::100], right[::100], strict=True):
        assert isinstance(given, Imu) and isinstance(expected, Imu)
        assert found.applied_to(given).wz_radps == pytest.approx(expected.wz_radps, abs=0.15)


@pytest.mark.parametrize("bias", [0.0, 0.05, -0.3])
def test_a_right_gyro_is_left_as_it_is(bias: float) -> None:
    assert find_gyro_correction(readings((0.0, 0.0, 1.0), bias=bias), track()) is None


def test_only_a_right_gyro_confirms_the_scans() -> None:
    assert is_gyro_with_scans(readings((0.0, 0.0, 1.0)), track())
    for wrong in ((0.0, 0.0, -1.0), (0.0, 0.0, 0.5), (0.0, 0.0, 0.0)):
        assert not is_gyro_with_scans(readings(wrong), track())
    assert not is_gyro_with_scans([], track())


def test_an_imu_whose_accelerations_point_down_hangs_upside_down() -> None:
    up = [Imu(k, "imu", 0.0, accel_mps2=(0.1, 0.0, 9.8)) for k in range(3)]
    down = [Imu(k, "imu", 0.0, accel_mps2=(0.1, 0.0, -9.8)) for k in range(3)]
    placed = Transform(0, "base", "imu", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), is_static=True)
    assert not points_down(up)
    assert points_down(down)
    assert not points_down([placed, *down])
    assert not points_down([Imu(0, "imu", 0.0)])


def test_rates_beyond_all_units_do_not_end_the_program() -> None:
    damaged = [*readings((0.0, 0.0, 1.0)), Imu(20 * NS, "imu", 1e300, -1e300, 1e308)]
    assert find_gyro_correction(damaged, track()) is None


def test_a_gyro_of_noise_alone_is_not_corrected() -> None:
    assert find_gyro_correction(readings((0.0, 0.0, 0.0)), track()) is None
    assert find_gyro_correction([], track()) is None


@pytest.mark.parametrize("quat", [(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)])
def test_an_imu_with_turned_axes_that_its_extrinsics_state_is_no_fault(
    quat: tuple[float, float, float, float],
) -> None:
    placed = Transform(0, "base", "imu", (0.0, 0.0, 0.0), quat, is_static=True)
    found = find_gyro_correction([placed, *readings((0.0, 1.0, 0.0))], track())
    assert found is not None
    assert not found.is_fault
    assert found.applied_to(Imu(0, "imu", 0.0, 0.0, 0.7)).wz_radps == pytest.approx(0.7)
    assert found.applied_to(Imu(0, "other", 0.1)).wz_radps == 0.1


def test_an_imu_upside_down_by_its_extrinsics_keeps_the_sign_that_they_undo() -> None:
    placed = Transform(0, "base", "imu", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), is_static=True)
    assert find_gyro_correction([placed, *readings((0.0, 0.0, -1.0))], track()) is None
    found = find_gyro_correction([placed, *readings((0.0, 0.0, 1.0))], track())
    assert isinstance(found, GyroCorrection)
    assert found.is_reversed
