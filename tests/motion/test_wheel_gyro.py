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
    turn, way = 100 * 0.05 * RADIUS / BASE, 100 * 0.125 * RADIUS
    expected = [way / turn * math.sin(turn), way / turn * (1 - math.cos(turn)), turn]
    assert np.allclose(motion.stretch().T_stop_now, expected, atol=1e-12)
    assert len(motion.stretch().path) == 101


def test_odometry_alone_is_repeated_whatever_its_frame() -> None:
    motion = WheelGyro(WheelGyroNoise(), MotionLimits())
    start, steps = np.array([5.0, -3.0, 2.9]), np.array([0.02, 0.003, 0.04])
    pose = start
    for k in range(60):
        motion.add_odometry(odometry(k, *pose))
        pose, last = se2.compose(pose, steps), pose
    motion.flush()
    motion.advance_to(motion.total_rows)
    assert np.allclose(motion.stretch().T_stop_now, se2.between(start, last), atol=1e-9)


def drive_with_slip(
    motion: WheelGyro,
    bias: float,
    seed: int = 0,
    scale: float = 1.0,
    ticks: int = 300,
    stop_at: int | None = None,
) -> float:
    """Stands 5 s, turns by 90 degrees while the wheels claim 20 % more, stands 5 s; returns the true turn.

    It ends after so many `ticks`, and with `stop_at` a stretch ends before that one.
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


def test_the_gyro_tells_the_turn_where_wheels_slip_and_its_bias_is_learned_while_standing() -> None:
    motion = wheel_filter()
    true = drive_with_slip(motion, bias=0.01)
    assert motion.stretch().T_stop_now[2] == pytest.approx(true, abs=0.01)
    without = WheelGyro(replace(WheelGyroNoise(), gyro_per_root_s=10.0), MotionLimits(), RADIUS, BASE)
    drive_with_slip(without, bias=0.01)
    assert abs(without.stretch().T_stop_now[2] - true) > 0.2


def test_the_stated_deviation_of_the_heading_covers_the_error() -> None:
    off = []
    for seed in range(12):
        motion = wheel_filter()
        true = drive_with_slip(motion, bias=0.005, seed=seed)
        stretch = motion.stretch()
        off.append((stretch.T_stop_now[2] - true) / math.sqrt(stretch.covariance[2, 2]))
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def test_a_stop_begins_a_new_stretch() -> None:
    motion = wheel_filter()
    drive_with_slip(motion, bias=0.01)
    first = motion.stop()
    assert len(first.path) == 300
    assert np.array_equal(motion.stretch().T_stop_now, np.zeros(3))
    assert len(motion.stretch().path) == 0


def test_a_stop_keeps_the_bias_that_was_learned_before_it() -> None:
    motion = wheel_filter()
    true = drive_with_slip(motion, bias=0.05, ticks=200, stop_at=100)
    assert len(motion.stretch().path) == 100
    assert motion.stretch().T_stop_now[2] == pytest.approx(true, abs=0.02)  # 0.25 off with the bias forgotten


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
    assert np.array_equal(whole.stretch().path, split.stretch().path)


def test_a_gyro_that_falls_silent_leaves_the_wheels_alone() -> None:
    motion = wheel_filter()
    for k in range(100):
        if k < 20:
            motion.add_imu(Imu(k * PERIOD_NS + 1, "imu", 0.0))
        motion.add_wheels(wheels(k, 0.1 * k, 0.15 * k))
    motion.flush()
    motion.advance_to(motion.total_rows)
    headings = motion.stretch().path[:, 2]
    assert len(headings) == 100
    assert headings[99] - headings[30] == pytest.approx(69 * 0.05 * RADIUS / BASE, abs=1e-12)


def test_a_jump_of_the_counters_is_no_motion_but_makes_the_pose_uncertain() -> None:
    motion = wheel_filter()
    for k in range(20):
        offset = 1000.0 if k >= 10 else 0.0
        motion.add_wheels(wheels(k, 0.1 * k + offset, 0.1 * k + offset))
    motion.flush()
    motion.advance_to(motion.total_rows)
    stretch = motion.stretch()
    assert motion.counters["wheels.jumps"] == 1
    assert stretch.T_stop_now[0] == pytest.approx(18 * 0.1 * RADIUS)
    assert math.sqrt(stretch.covariance[0, 0]) > 0.2


def test_what_is_not_finite_or_absurd_is_counted_and_left_out() -> None:
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
    assert motion.counters["skipped.imu.steps_back"] == 1
    assert motion.counters["unused.odom"] == 1
    plain = WheelGyro(WheelGyroNoise(), MotionLimits())
    plain.add_odometry(odometry(0, math.nan, 0.0, 0.0))
    plain.add_wheels(wheels(0, 0.0, 0.0))
    assert plain.counters["skipped.odom.not_finite"] == 1
    assert plain.counters["unused.wheels"] == 1
    assert not plain.is_known
