"""Coupling of neighbouring rays and the update of the cells, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.stereo.chain import RayEvidence
from gridslam.kernels.stereo.stereo_update import (
    CellEvidence,
    UpdateRule,
    apply_update,
    couple_neighbouring_rays,
)
from tests.reference import stereo_update as reference


@pytest.mark.parametrize("strength", [0.3, 0.5, 1.0])
def test_neighbouring_rays_exchange_messages_through_their_correlation(strength: float) -> None:
    rng = np.random.default_rng(0)
    evidence = RayEvidence(*rng.uniform(0.2, 3.0, (2, 6, 9)), reached=rng.random((6, 9)))
    bearings, ranges = np.sort(rng.uniform(-0.3, 0.3, 6)), np.arange(2.0, 11.0)
    found = couple_neighbouring_rays(evidence, bearings, ranges, 0.8, strength)
    occupied, empty = reference.couple_neighbouring_rays(evidence, bearings, ranges, 0.8, strength)
    assert found.occupied == pytest.approx(occupied, abs=1e-12)
    assert found.empty == pytest.approx(empty, abs=1e-12)
    assert found.reached is evidence.reached


def test_a_lone_ray_does_not_change() -> None:
    one = np.full((1, 4), 2.0)
    found = couple_neighbouring_rays(RayEvidence(one, 0.5 * one, one), np.zeros(1), np.arange(4.0), 0.9, 1.0)
    assert (found.occupied == one).all() and (found.empty == 0.5 * one).all()


@pytest.mark.parametrize("once", [False, True])
def test_cells_change_by_the_likelihood_ratio_and_behind_surfaces_up_to_the_expectation(once: bool) -> None:
    rng = np.random.default_rng(1)
    log_odds, reached = rng.normal(0.0, 3.0, (8, 7)), rng.random((8, 7))
    evidence = CellEvidence(*rng.uniform(0.1, 5.0, (2, 8, 7)), *rng.random((3, 8, 7)))
    for values, no_evidence in zip(evidence, (1.0, 1.0, 0.0, 0.0, 0.0), strict=True):
        values[0] = no_evidence  # cells that no ray meets
    rule = UpdateRule(0.4, prior_log_odds=-1.2, max_log_odds=4.0, min_probability=1e-3, behind_once=once)
    expected = reference.updated(log_odds, reached, evidence, rule)
    apply_update(log_odds, reached, evidence, rule)
    assert log_odds == pytest.approx(expected[0], abs=1e-12)
    assert reached == pytest.approx(expected[1], abs=1e-12)
