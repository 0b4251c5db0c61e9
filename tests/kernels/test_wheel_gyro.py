from __future__ import annotations

import numpy as np

from gridslam.kernels import wheel_gyro as kernel
from gridslam.motion.wheel_gyro import WheelGyroNoise
from tests.reference import wheel_gyro as reference


def test_the_filter_is_its_twin_on_random_motion_with_and_without_gyro() -> None:
    rng = np.random.default_rng(3)
    n = 200
    increments = np.column_stack(
        [
            rng.uniform(-0.01, 0.03, n),
            rng.normal(0.0, 0.001, n),
            rng.normal(0.0, 0.05, n),
            rng.uniform(0.01, 0.1, n),
            np.where(rng.random(n) < 0.2, np.nan, rng.normal(0.0, 0.05, n)),
            rng.random(n) < 0.02,
        ]
    )
    variances = WheelGyroNoise().variances()
    state, covariance, path = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4]), np.empty((n, 3))
    kernel.advance(state, covariance, increments, variances, path)
    x, P = np.zeros(4), np.diag([0.0, 0.0, 0.0, 4e-4])
    for increment, pose in zip(increments, path, strict=True):
        x, P = reference.step(x, P, increment, variances)
        assert np.allclose(pose, x[:3], atol=1e-9)
    assert np.allclose(state, x, atol=1e-9)
    assert np.allclose(covariance, P, rtol=1e-6, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > -1e-15
