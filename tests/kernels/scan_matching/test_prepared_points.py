"""The points of a scan in one call."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.scan_matching.prepared_points import PointDensity, PreparedPoints, prepare_points
from gridslam.kernels.scan_matching.scan_points import RangeLimits, Sweep
from tests.reference.scan_points import prepare_points as reference


@given(seed=st.integers(0, 10_000), n=st.integers(0, 120))
@settings(max_examples=40, deadline=None)
def test_one_call_gives_what_its_steps_give_one_by_one(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    ranges = (4.0 + np.cumsum(rng.normal(0.0, 0.02, n))).astype(np.float32)
    ranges[rng.random(n) < 0.1] = rng.choice([0.01, np.nan, np.inf, 40.0])
    arguments = (
        ranges,
        Sweep(-1.5, 0.02, 0.0004),
        RangeLimits(0.05, 30.0),
        rng.uniform(-1.0, 1.0, 3),
        rng.uniform(-0.5, 0.5, 3),
        PointDensity(0.03, 40, 2.0, 0.1),
    )
    found = prepare_points(*arguments)
    for name, a, b in zip(PreparedPoints._fields, found, reference(*arguments), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-12, err_msg=name)
