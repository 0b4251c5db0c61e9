"""The deformed path is the conditional mean of a Gaussian path given its end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.drift import Drift, deformed_path


def random_path(rng: np.random.Generator, n: int) -> np.ndarray:
    path = [np.zeros(3)]
    for _ in range(n - 1):
        path.append(se2.compose(path[-1], rng.normal([0.3, 0.0, 0.0], [0.1, 0.05, 0.2])))
    return np.array(path)


@given(seed=st.integers(0, 10_000), n=st.integers(2, 40))
@settings(max_examples=80, deadline=None)
def test_a_deformed_path_keeps_its_start_and_reaches_its_end(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    path = random_path(rng, n)
    step_std = np.tile([0.01, 0.01, 0.01], (n - 1, 1))
    end = path[-1] + rng.normal(0.0, [0.05, 0.05, 0.01])
    deformed = deformed_path(path, end, step_std)
    np.testing.assert_array_equal(deformed[0], path[0])
    missing = end - deformed[-1]
    assert np.hypot(missing[0], missing[1]) < 0.1 * np.hypot(*(end - path[-1])[:2]) + 0.01
    assert abs(float(se2.wrap_angle(missing[2]))) < 1e-6 + 0.1 * abs(
        float(se2.wrap_angle(end[2] - path[-1, 2]))
    )


def test_a_small_deformation_is_the_conditional_mean_by_dense_algebra() -> None:
    rng = np.random.default_rng(7)
    path = random_path(rng, 6)
    step_std = rng.uniform(0.005, 0.02, (5, 3))
    step_std[:, 1] = step_std[:, 0]
    # All step errors e (15,), and the linear map from them to the displacement of every pose.
    effect = np.zeros((6, 3, 15))
    for k in range(5):
        for later in range(k + 1, 6):
            lever = path[later, :2] - path[k + 1, :2]
            effect[later, 0, 3 * k], effect[later, 1, 3 * k + 1] = 1.0, 1.0
            effect[later, :, 3 * k + 2] = [-lever[1], lever[0], 1.0]
    covariance = np.diag((step_std**2).ravel())
    offset = np.array([1e-5, -2e-5, 1e-5])
    gain = covariance @ effect[5].T @ np.linalg.inv(effect[5] @ covariance @ effect[5].T)
    expected = path + effect @ gain @ offset
    np.testing.assert_allclose(deformed_path(path, path[-1] + offset, step_std), expected, atol=1e-8)


def test_the_covariance_of_the_drift_is_that_of_sampled_paths() -> None:
    rng = np.random.default_rng(1)
    path = random_path(rng, 15)
    step_std = np.array([0.01, 0.01, 0.005])
    drift = Drift(1)
    samples = np.tile(path[0], (40_000, 1))
    for before, after in pairwise(path):
        drift.add_step(before[None], after[None], step_std)
        noise = rng.standard_normal((len(samples), 3)) * step_std
        samples = se2.compose(samples, se2.compose(se2.between(before, after)[None], noise))
    sampled = np.cov((samples - path[-1]).T)
    np.testing.assert_allclose(drift.covariance[0], sampled, atol=0.05 * np.abs(sampled).max())
