"""The measurement of every bin of columns, against histograms by numpy."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.stereo_columns import MATCHED, measure_columns
from tests.reference import stereo_columns as reference


@pytest.mark.parametrize("seed", range(6))
def test_bins_have_the_most_frequent_disparity_of_what_stands_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    disparity = rng.uniform(-2.0, 33.0, (24, 60)).astype(np.float32)
    disparity[:, 20:50] = rng.normal(12.0, 0.4, (24, 30))
    disparity[rng.random(disparity.shape) < 0.2] = np.nan
    disparity[:, :5] = np.nan
    slope = np.repeat(np.linspace(0.3, -0.3, 24, dtype=np.float32)[:, None], 60, axis=1)
    extent = np.maximum(0.8 * np.arange(65), 6.0)
    arguments = (disparity, slope, 30.0, 0.6, 0.1, 1.5, 5, 32.0, extent, 0.3)
    found, status = measure_columns(*arguments, False)
    expected = reference.measure_columns(*arguments)
    assert status.tolist() == [kind for _, kind in expected]
    assert {MATCHED, reference.UNKNOWN} <= set(status.tolist())
    np.testing.assert_allclose(found, [value for value, _ in expected], rtol=1e-9)
