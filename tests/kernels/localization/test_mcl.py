"""Systematic resampling and the count of bins against the reference implementations."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.localization.mcl import occupied_bins, systematic
from tests.reference import mcl as reference


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 30), st.integers(1, 60))
def test_systematic_resampling_equals_the_reference_implementation(seed, n, count):
    rng = np.random.default_rng(seed)
    weights = rng.random(n) ** 4 * (rng.random(n) < 0.7)
    weights[rng.integers(n)] += 0.1
    start = float(rng.random())
    ours = systematic(weights, count, start)
    assert ours.tolist() == reference.systematic(weights.tolist(), count, start)


@settings(max_examples=80, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 30))
def test_the_number_of_copies_of_a_particle_differs_from_its_weight_by_less_than_one(seed, n):
    rng = np.random.default_rng(seed)
    weights = rng.random(n)
    counts = np.bincount(systematic(weights, 100, float(rng.random())), minlength=n)
    assert np.all(np.abs(counts - 100 * weights / weights.sum()) < 1.0 + 1e-9)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 200))
def test_bins_are_counted_once(seed, n):
    rng = np.random.default_rng(seed)
    poses = rng.normal(0.0, 1.0, (n, 3))
    chosen = rng.integers(0, n, 2 * n)
    assert occupied_bins(poses, chosen, 0.3, 0.4) == reference.occupied_bins(poses, chosen, 0.3, 0.4)
