from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.messages import Imu, Odometry, WheelTicks
from gridslam.motion.wheel_gyro import MotionLimits, WheelGyro, WheelGyroNoise

RADIUS, BASE = 0.035, 0.2
PERIOD_NS = 50_000_000


def wheels(k: int, left: float, right: float) -> WheelTicks:
    return WheelTicks(k * PERIOD_NS, "base_link", left, right)


def odometry(k: int, x: float, y: float, yaw: float) -> Odometry:
    return Odometry(k * PERIOD_NS, "odom", x, y, yaw)


def wheel_filter() -> WheelGyro:
    return WheelGyro(WheelGyroNoise(), MotionLimits(), RADIUS, BASE)


def test_wheels_alone_drive_the_arc_of_the_differential_drive() -> None:
    motion = wheel_filter()
    for k in range(101):
        motion.add_wheels(wheels(k, 0.1 * k, 0.15 * k))
    motion.flush()
    motion.advance_to(motion.total_rows)
    yaw, distance = 100 * 0.05 * RADIUS / BASE, 100 * 0.125 * RADIUS
    expected = [distance / yaw * math.sin(yaw), distance / yaw * (1 - math.cos(yaw)), yaw]
    assert np.allclose(motion.motion().T_stop_now, expected, atol=1e-12)
    assert len(motion.motion().path) == 101


def test_odometry_alone_is_reproduced_from_any_start() -> None:
    motion = WheelGyro(WheelGyroNoise(), MotionLimits())
    start, steps = np.array([5.0, -3.0, 2.9]), np.array([0.02, 0.003, 0.04])
    pose = start
    for k in range(60):
        motion.add_odometry(odometry(k, *pose))
        pose, last = se2.compose(pose, steps), pose
    motion.flush()
    motion.advance_to(motion.total_rows)
    assert np.allclose(motion.motion().T_stop_now, se2.between(start, last), atol=1e-9)


def drive_with_slip(
    motion: WheelGyro,
    bias: float,
    seed: int = 0,
    scale: float = 1.0,
    ticks: int = 300,
    stop_at: int | None = None,
) -> float:
    """Stand for 5 s, turn by 90 degrees while the wheels measure 20 % more, stand for 5 s; returns the true yaw.

    The drive has `ticks` wheel messages; with `stop_at` there is a stop before that message.
    """
    rng = np.random.default_rng(seed)
    true, angle, tick = 0.0, 0.0, 0
    for k in range(ticks):
        if k == stop_at:
            motion.flush()
            motion.advance_to(motion.total_rows)
            motion.stop()
        rate = 0.5 * math.pi / 5.0 if 100 <= k < 200 else 0.0
        for j in range(5):
            motion.add_imu(
                Imu(
                    k * PERIOD_NS + (j + 1) * PERIOD_NS // 5,
                    "imu",
                    scale * rate + bias + 0.004 * rng.standard_normal(),
                )
            )
        true += rate * 0.05
        angle += 1.2 * rate * 0.05 * 0.5 * BASE / RADIUS
        tick = k + 1
        motion.add_wheels(wheels(tick, -angle, angle))
    motion.flush()
    motion.advance_to(motion.total_rows)
    return true


def test_the_gyro_gives_the_yaw_if_wheels_slip_and_its_bias_is_estimated_while_standing() -> None:
    motion = wheel_filter()
    true = drive_with_slip(motion, bias=0.01)
    assert motion.motion().T_stop_now[2] == pytest.approx(true, abs=0.01)
    without = WheelGyro(replace(WheelGyroNoise(), gyro_per_root_s=10.0), MotionLimits(), RADIUS, BASE)
    drive_with_slip(without, bias=0.01)
    assert abs(without.motion().T_stop_now[2] - true) > 0.2


def test_the_standard_deviation_of_the_yaw_matches_its_error() -> None:
    errors = []
    for seed in range(12):
        motion = wheel_filter()
        true = drive_with_slip(motion, bias=0.005, seed=seed)
        relative = motion.motion()
        errors.append((relative.T_stop_now[2] - true) / math.sqrt(relative.covariance[2, 2]))
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


def test_the_motion_starts_again_at_a_stop() -> None:
    motion = wheel_filter()
    drive_with_slip(motion, bias=0.01)
    first = motion.stop()
    assert len(first.path) == 300
    assert np.array_equal(motion.motion().T_stop_now, np.zeros(3))
    assert len(motion.motion().path) == 0


def test_a_stop_keeps_the_estimated_bias() -> None:
    motion = wheel_filter()
    true = drive_with_slip(motion, bias=0.05, ticks=200, stop_at=100)
    assert len(motion.motion().path) == 100
    # The error is 0.25 without the bias
    assert motion.motion().T_stop_now[2] == pytest.approx(true, abs=0.02)


def test_marks_split_the_motion_without_changing_it() -> None:
    def filled() -> WheelGyro:
        motion = wheel_filter()
        for k in range(50):
            motion.add_wheels(wheels(k, 0.1 * k, 0.12 * k))
        return motion

    whole, split = filled(), filled()
    whole.advance_to(50)
    for mark in (13, 13, 5, 31, 50):
        split.advance_to(mark)
    assert np.array_equal(whole.motion().path, split.motion().path)


def test_without_new_gyro_messages_the_wheels_are_used_alone() -> None:
    motion = wheel_filter()
    for k in range(100):
        if k < 20:
            motion.add_imu(Imu(k * PERIOD_NS + 1, "imu", 0.0))
        motion.add_wheels(wheels(k, 0.1 * k, 0.15 * k))
    motion.flush()
    motion.advance_to(motion.total_rows)
    headings = motion.motion().path[:, 2]
    assert len(headings) == 100
    assert headings[99] - headings[30] == pytest.approx(69 * 0.05 * RADIUS / BASE, abs=1e-12)


def test_a_jump_of_the_encoders_is_no_motion_but_makes_the_pose_uncertain() -> None:
    motion = wheel_filter()
    for k in range(20):
        offset = 1000.0 if k >= 10 else 0.0
        motion.add_wheels(wheels(k, 0.1 * k + offset, 0.1 * k + offset))
    motion.flush()
    motion.advance_to(motion.total_rows)
    relative = motion.motion()
    assert motion.counters["wheels.jumps"] == 1
    assert relative.T_stop_now[0] == pytest.approx(18 * 0.1 * RADIUS)
    assert math.sqrt(relative.covariance[0, 0]) > 0.2


def test_values_that_are_not_finite_or_absurd_are_counted_and_skipped() -> None:
    motion = wheel_filter()
    motion.add_wheels(wheels(0, 0.0, 0.0))
    motion.add_wheels(wheels(1, math.nan, 0.0))
    motion.add_imu(Imu(0, "imu", math.inf))
    motion.add_imu(Imu(1, "imu", 1e6))
    motion.add_imu(Imu(10, "imu", 0.1))
    motion.add_imu(Imu(10, "imu", 0.1))
    motion.add_odometry(odometry(0, 0.0, 0.0, 0.0))
    assert motion.counters["skipped.wheels.not_finite"] == 1
    assert motion.counters["skipped.imu.absurd"] == 2
    assert motion.counters["skipped.imu.out_of_order"] == 1
    assert motion.counters["unused.odom"] == 1
    plain = WheelGyro(WheelGyroNoise(), MotionLimits())
    plain.add_odometry(odometry(0, math.nan, 0.0, 0.0))
    plain.add_wheels(wheels(0, 0.0, 0.0))
    assert plain.counters["skipped.odom.not_finite"] == 1
    assert plain.counters["unused.wheels"] == 1
    assert not plain.is_known
