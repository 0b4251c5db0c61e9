"""The measurement of every bin of columns against numpy histograms."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.stereo.stereo_columns import MATCHED, BinCriteria, HeightBand, measure_columns
from tests.reference import stereo_columns as reference


@pytest.mark.parametrize("seed", range(6))
def test_bins_have_the_most_frequent_disparity_of_their_obstacles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = rng.uniform(-2.0, 33.0, (24, 60)).astype(np.float32)
    disparity[:, 20:50] = rng.normal(12.0, 0.4, (24, 30))
    disparity[rng.random(disparity.shape) < 0.2] = np.nan
    disparity[:, :5] = np.nan
    slope = np.repeat(np.linspace(0.3, -0.3, 24, dtype=np.float32)[:, None], 60, axis=1)
    extent = np.maximum(0.8 * np.arange(65), 6.0)
    band = HeightBand(slope, focal_baseline=30.0, camera_m=0.6, low_m=0.1, high_m=1.5)
    criteria = BinCriteria(5, 32.0, extent, min_matched_ratio=0.3, take_nearest=False)
    found, status = measure_columns(disparity, band, criteria)
    expected = reference.measure_columns(disparity, band, criteria)
    assert status.tolist() == [kind for _, kind in expected]
    assert {MATCHED, reference.UNKNOWN} <= set(status.tolist())
    np.testing.assert_allclose(found, [value for value, _ in expected], rtol=1e-9)
