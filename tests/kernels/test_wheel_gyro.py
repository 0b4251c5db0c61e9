from __future__ import annotations

import numpy as np

from gridslam.kernels import wheel_gyro as kernel
from gridslam.motion.wheel_gyro import WheelGyroNoise
from tests.reference import wheel_gyro as reference


def test_the_filter_agrees_with_the_reference_on_random_motion_with_and_without_gyro() -> None:
    rng = np.random.default_rng(3)
    n = 200
    increments = kernel.WheelIncrements(
        forward_m=rng.uniform(-0.01, 0.03, n),
        lateral_m=rng.normal(0.0, 0.001, n),
        yaw_rad=rng.normal(0.0, 0.05, n),
        seconds=rng.uniform(0.01, 0.1, n),
        gyro_rad=np.where(rng.random(n) < 0.2, np.nan, rng.normal(0.0, 0.05, n)),
        is_lost=(rng.random(n) < 0.02).astype(np.float64),
    )
    variances = WheelGyroNoise().variances()
    state, covariance, poses = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4]), np.empty((n, 3))
    kernel.advance(state, covariance, increments, variances, poses)
    x, P = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4])
    for k, pose in enumerate(poses):
        x, P = reference.step(x, P, increments, k, variances)
        assert np.allclose(pose, x[:3], atol=1e-9)
    assert np.allclose(state, x, atol=1e-9)
    assert np.allclose(covariance, P, rtol=1e-6, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > -1e-15
