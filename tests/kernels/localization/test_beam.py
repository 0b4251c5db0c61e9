"""The kernel of the beam model against ray casting with a table look-up."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.grids.raycast import free_squares
from gridslam.kernels.localization.beam import MeasuredBeams, RangeTable, sum_over_ranges
from tests.reference import mcl as reference


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_each_beam_is_looked_up_under_its_expected_range(seed):
    rng = np.random.default_rng(seed)
    occupied = rng.random((30, 30)) < 0.03
    # Smooth in the expected range, so that a range on the edge of two bins does not matter.
    table = (np.arange(40)[:, None] + 1e-4 * np.arange(40)[None]).astype(np.float32)
    poses = np.column_stack([rng.uniform(3, 27, (5, 2)), rng.uniform(-4, 4, 5)])
    sensor = np.array([0.7, -0.4, 0.3])
    bearings, measured = rng.uniform(-2, 2, 6), rng.integers(0, 40, 6)
    beams = MeasuredBeams(bearings, measured, sensor, 19.0)
    sums = sum_over_ranges(free_squares(occupied), RangeTable(table, 0.5), beams, poses)
    for pose, got in zip(poses, sums, strict=True):
        total = reference.sum_over_ranges(occupied, RangeTable(table, 0.5), beams, pose)
        assert abs(got - total) < 1e-3
