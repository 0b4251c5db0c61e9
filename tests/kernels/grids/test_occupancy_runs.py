"""Runs of the same state against walks one at a time."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.grids.occupancy_runs import UNKNOWN, follow_runs
from tests.reference.occupancy_runs import follow_run


@pytest.mark.parametrize("seed", range(4))
def test_runs_end_where_the_state_changes_or_is_unknown(seed: int) -> None:
    rng = np.random.default_rng(seed)
    state = rng.choice([0, 0, 0, 1, UNKNOWN], (20, 30), p=[0.3, 0.3, 0.25, 0.1, 0.05]).astype(np.int8)
    known = np.argwhere(state != UNKNOWN)
    starts = known[rng.integers(len(known), size=200)]
    steps = np.array([(0, 1), (1, 0), (-1, -1), (1, -1)])[rng.integers(4, size=200)]
    length, changed = follow_runs(state, starts, steps)
    expected = [
        follow_run(state, (int(a), int(b)), (int(c), int(d)), UNKNOWN)
        for (a, b), (c, d) in zip(starts, steps, strict=True)
    ]
    assert list(zip(length.tolist(), changed.tolist(), strict=True)) == expected
