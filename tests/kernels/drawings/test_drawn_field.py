"""Scores on a stretched drawing against the reference implementation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.drawings.drawn_field import sum_over_stretched_points
from tests.reference import drawn_field as reference


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_sums_equal_those_of_the_reference(seed):
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(2, 60, 2)
    field = rng.uniform(0.0, 3.0, (rows, cols)).astype(np.float32)
    table = rng.normal(size=64).astype(np.float32)
    points = rng.uniform(-8.0, 8.0, (15, 2))
    states = np.column_stack(
        [
            rng.uniform(0.0, 0.1 * cols, 5),
            rng.uniform(0.0, 0.1 * rows, 5),
            rng.uniform(-4.0, 4.0, 5),
            rng.uniform(-1.0, 1.0, (5, 2)),
        ]
    )
    sums = sum_over_stretched_points(field, 0.1, table, 30.0, points, states)
    wanted = [reference.sum_over_stretched_points(field, 0.1, table, 30.0, points, state) for state in states]
    assert sums == pytest.approx(wanted, abs=1e-6)
