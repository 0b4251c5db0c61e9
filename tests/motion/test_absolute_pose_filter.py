"""The Kalman filter of the pose: absolute poses in any order, the gate, and the start."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.motion.absolute_pose_filter import (
    AbsolutePoseFilter,
    FilterSettings,
    PoseBelief,
    RootMotionNoise,
)

Floats = NDArray[np.float64]

NOISE = RootMotionNoise(0.05, 0.05, 0.02)
MEASURED = np.diag([0.03**2, 0.03**2, 0.02**2])
SECOND = 10**9


def filter_of(start: PoseBelief | None = None) -> AbsolutePoseFilter:
    return AbsolutePoseFilter(NOISE, FilterSettings(reset_after=5), start)


def drive(n: int) -> Floats:
    """Poses `(n, 3)` along an arc, ten a second."""
    t = np.arange(n) * 0.1
    return np.column_stack([2.0 * np.sin(0.25 * t), 2.0 * (1.0 - np.cos(0.25 * t)), 0.25 * t])


def stamp(k: int) -> int:
    return k * SECOND // 10


def test_the_order_of_arrival_of_absolute_poses_does_not_matter() -> None:
    rng = np.random.default_rng(0)
    path = drive(60)
    measured = [(k, path[k] + rng.normal(0.0, [0.03, 0.03, 0.02])) for k in range(0, 60, 5)]
    in_order, late = filter_of(), filter_of()
    waiting = []
    for k in range(60):
        for tracker in (in_order, late):
            tracker.add_odometry(stamp(k), path[k])
        for when, pose in measured:
            if when == k:
                in_order.add_absolute_pose(stamp(k), pose, MEASURED)
                waiting.append((k, pose))
        if k % 20 == 19:
            for when, pose in reversed(waiting):
                late.add_absolute_pose(stamp(when), pose, MEASURED)
            waiting.clear()
    for k in (30, 59):
        a, b = in_order.at(stamp(k)), late.at(stamp(k))
        assert a is not None
        assert b is not None
        np.testing.assert_allclose(a.pose, b.pose, atol=1e-9)
        np.testing.assert_allclose(a.covariance, b.covariance, atol=1e-9)
    assert in_order.counters == late.counters


def test_the_first_absolute_pose_is_the_start_and_the_next_is_fused_by_covariance() -> None:
    tracker = filter_of()
    tracker.add_odometry(0, np.zeros(3))
    assert tracker.at(0) is None
    tracker.add_absolute_pose(0, np.array([1.0, 2.0, 0.5]), MEASURED)
    first = tracker.at(0)
    assert first is not None
    np.testing.assert_allclose(first.pose, [1.0, 2.0, 0.5])
    tracker.add_odometry(SECOND, np.zeros(3))
    tracker.add_absolute_pose(SECOND, np.array([1.02, 2.0, 0.5]), MEASURED)
    second = tracker.at(SECOND)
    assert second is not None
    np.testing.assert_allclose(second.pose, [1.01, 2.0, 0.5], atol=1e-12)  # equal covariances: the mean
    np.testing.assert_allclose(second.covariance, 0.5 * MEASURED, atol=1e-12)


def test_an_absolute_pose_beyond_the_gate_is_rejected_and_counted() -> None:
    tracker = filter_of(PoseBelief(np.zeros(3), 0.01 * MEASURED))
    tracker.add_odometry(0, np.zeros(3))
    tracker.add_odometry(SECOND, np.zeros(3))
    tracker.add_absolute_pose(SECOND, np.array([1.0, 0.0, 0.0]), MEASURED)
    belief = tracker.at(SECOND)
    assert belief is not None
    np.testing.assert_allclose(belief.pose, 0.0)
    assert tracker.counters == {"skipped.pose.rejected": 1}


def test_rejected_poses_that_agree_with_each_other_reset_the_filter() -> None:
    tracker = filter_of(PoseBelief(np.zeros(3), 0.01 * MEASURED))
    for k in range(6):
        tracker.add_odometry(stamp(k), np.zeros(3))
        tracker.add_absolute_pose(stamp(k), np.array([5.0, 0.0, 0.0]), MEASURED)
    belief = tracker.at(stamp(5))
    assert belief is not None
    assert belief.pose[0] == pytest.approx(5.0, abs=0.05)
    assert tracker.counters == {"skipped.pose.rejected": 4, "used.pose": 2, "pose.resets": 1}


def test_rejected_poses_agree_if_odometry_leads_from_one_to_the_next() -> None:
    """The robot drives on, and the absolute poses follow it from a wrong start."""
    tracker = filter_of(PoseBelief(np.zeros(3), 0.01 * MEASURED))
    for k in range(6):
        tracker.add_odometry(stamp(k), np.array([0.5 * k, 0.0, 0.0]))
        tracker.add_absolute_pose(stamp(k), np.array([5.0, 0.5 * k, np.pi / 2]), MEASURED)
    belief = tracker.at(stamp(5))
    assert belief is not None
    np.testing.assert_allclose(belief.pose, [5.0, 2.5, np.pi / 2], atol=0.05)
    assert tracker.counters["pose.resets"] == 1


def test_outliers_that_disagree_never_reset_the_filter() -> None:
    rng = np.random.default_rng(0)
    tracker = filter_of(PoseBelief(np.zeros(3), 0.01 * MEASURED))
    for k in range(100):
        tracker.add_odometry(stamp(k), np.zeros(3))
        tracker.add_absolute_pose(stamp(k), np.append(rng.uniform(100.0, 2000.0, 2), 0.0), MEASURED)
    belief = tracker.at(stamp(99))
    assert belief is not None
    np.testing.assert_allclose(belief.pose, 0.0)
    assert tracker.counters == {"skipped.pose.rejected": 100}


def test_absolute_poses_older_than_the_window_are_rejected() -> None:
    tracker = filter_of(PoseBelief(np.zeros(3), MEASURED))
    for k in range(300):
        tracker.add_odometry(stamp(k), np.zeros(3))
    tracker.add_absolute_pose(stamp(10), np.zeros(3), MEASURED)
    assert tracker.counters == {"skipped.pose.too_late": 1}


@pytest.mark.parametrize("bad", [np.array([np.nan, 0.0, 0.0]), np.array([np.inf, 0.0, 0.0])])
def test_an_absolute_pose_that_is_not_finite_is_counted(bad: Floats) -> None:
    tracker = filter_of(PoseBelief(np.zeros(3), MEASURED))
    tracker.add_odometry(0, np.zeros(3))
    tracker.add_absolute_pose(0, bad, MEASURED)
    tracker.add_absolute_pose(0, np.zeros(3), np.zeros((3, 3)))
    assert tracker.counters == {"skipped.pose.not_finite": 2}


def test_without_odometry_absolute_poses_are_counted_as_unused() -> None:
    tracker = filter_of()
    tracker.add_absolute_pose(0, np.zeros(3), MEASURED)
    assert tracker.counters == {"skipped.pose.no_odometry": 1}


def test_the_noise_of_a_path_does_not_depend_on_its_steps() -> None:
    one, many = (filter_of(PoseBelief(np.zeros(3), 1e-12 * np.eye(3))) for _ in range(2))
    for tracker, steps in ((one, 2), (many, 201)):
        for k in range(steps):
            tracker.add_odometry(k * 1000, np.array([2.0 * k / (steps - 1), 0.0, 0.0]))
    a, b = one.at(1000), many.at(200_000)
    assert a is not None
    assert b is not None
    assert b.covariance[2, 2] == pytest.approx(a.covariance[2, 2], rel=1e-6)
    assert a.covariance[0, 0] == pytest.approx(2.0 * 0.05**2, rel=1e-6)


def test_between_two_odometry_messages_the_belief_is_interpolated() -> None:
    tracker = filter_of(PoseBelief(np.zeros(3), MEASURED))
    path = drive(2)
    for k in range(2):
        tracker.add_odometry(stamp(k), path[k])
    belief = tracker.at(stamp(1) // 2)
    assert belief is not None
    np.testing.assert_allclose(belief.pose, se2.interpolate(path[0], path[1], 0.5), atol=1e-12)
