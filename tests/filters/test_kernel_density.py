from __future__ import annotations

import numpy as np
import pytest

from gridslam.filters.kernel_density import kernel_density
from tests.reference.kernel_density import density_at


@pytest.mark.parametrize("seed", range(5))
def test_the_binned_density_equals_the_sum_over_all_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, [2.0, 0.7], (200, 2)) + rng.uniform(-50, 50, 2)
    weights = rng.random(200)
    h = float(rng.uniform(0.1, 0.8))
    density = kernel_density(points, weights, h)
    queries = points[:40] + rng.normal(0.0, 2.0 * h, (40, 2))
    direct = np.array([density_at(p, points, weights, h) for p in queries])
    assert np.abs(density.at(queries) - direct).max() < 0.02 * direct.max()


def test_the_density_integrates_to_one() -> None:
    density = kernel_density(np.array([[1.0, 2.0], [4.0, -3.0]]), np.array([1.0, 3.0]), 0.3)
    assert density.values.sum() * density.bin_m**2 == pytest.approx(1.0, abs=1e-3)


def test_one_point_is_its_kernel() -> None:
    density = kernel_density(np.array([[5.0, 5.0]]), np.ones(1), 0.5)
    peak = 1.0 / (2.0 * np.pi * 0.5**2)
    queries = np.array([[5.0, 5.0], [5.5, 5.0], [5.0, 4.0], [9.0, 9.0]])
    expected = peak * np.array([1.0, np.exp(-0.5), np.exp(-2.0), 0.0])
    np.testing.assert_allclose(density.at(queries), expected, atol=0.02 * peak)


def test_the_number_of_bins_is_bounded_for_distant_points() -> None:
    density = kernel_density(np.array([[0.0, 0.0], [1e5, 1e5]]), np.ones(2), 0.3)
    assert density.values.size < 8_000_000


def test_without_points_there_is_no_density() -> None:
    with pytest.raises(ValueError, match="no points"):
        kernel_density(np.zeros((0, 2)), np.zeros(0), 0.3)
