from __future__ import annotations

import math

import numpy as np

from gridslam.core import poses as se2
from gridslam.motion.odometry_model import OdometryNoise, sample_motion

SILENT = OdometryNoise(0.0, 0.0, 0.0, 0.0)


def test_without_noise_every_pose_moves_by_the_step():
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(-5, 5, (50, 2)), rng.uniform(-3, 3, 50)])
    for step in ([0.4, 0.1, 0.5], [-0.4, 0.02, -0.1], [0.0, 0.0, 2.0], [0.005, 0.0, 0.3]):
        moved = sample_motion(poses, np.array(step), SILENT, rng)
        off = moved - se2.compose(poses, np.array(step))
        off[:, 2] = se2.wrap_angle(off[:, 2])
        assert np.abs(off).max() < 0.006  # steps below a centimetre lose their direction


def test_noise_has_the_variances_of_the_model():
    noise = OdometryNoise(0.05, 0.02, 0.03, 0.01)
    step = np.array([0.5, 0.0, 0.4])  # straight, then a turn of 0.4
    moved = sample_motion(np.zeros((200_000, 3)), step, noise, np.random.default_rng(2))
    first = 0.02 * 0.5**2
    second = 0.05 * 0.4**2 + 0.02 * 0.5**2
    assert np.isclose(moved[:, 2].var(), first + second, rtol=0.02)
    length = np.hypot(moved[:, 0], moved[:, 1])
    assert np.isclose(length.var(), 0.03 * 0.5**2 + 0.01 * 0.4**2, rtol=0.02)


def test_driving_backwards_is_no_turn():
    noise = OdometryNoise(0.5, 0.0, 0.0, 0.0)
    moved = sample_motion(np.zeros((1000, 3)), np.array([-0.5, 0.0, 0.0]), noise, np.random.default_rng(3))
    np.testing.assert_allclose(moved, np.broadcast_to([-0.5, 0.0, 0.0], moved.shape), atol=1e-9)


def test_a_standing_robot_remains_where_it_is():
    noise = OdometryNoise(0.5, 0.5, 0.5, 0.5, 0.1, 5.0)
    moved = sample_motion(np.ones((100, 3)), np.zeros(3), noise, np.random.default_rng(4))
    np.testing.assert_array_equal(moved, np.ones((100, 3)))


def test_wild_samples_widen_the_tails():
    step = np.array([1.0, 0.0, 0.0])
    tame = OdometryNoise(0.0, 0.0, 0.01, 0.0)
    wild = OdometryNoise(0.0, 0.0, 0.01, 0.0, 0.1, 4.0)
    far = [
        float(
            (
                np.abs(sample_motion(np.zeros((50_000, 3)), step, n, np.random.default_rng(5))[:, 0] - 1)
                > 0.35
            ).mean()
        )
        for n in (tame, wild)
    ]
    # P(|z| > 3.5) = 0.00047 for all; P(|4 z| > 3.5) = 0.3816 for the wild (drawn with replacement: 9.5 %).
    assert far[0] < 0.001
    assert math.isclose(far[1], 0.00047 + 0.0952 * 0.381, rel_tol=0.06)
