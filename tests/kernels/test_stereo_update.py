"""Neighbouring rays and the cells' update, against versions in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.stereo_update import tell_cells, told_across
from tests.reference import stereo_update as reference


@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
def test_neighbouring_rays_pass_messages_through_their_correlation(share: float) -> None:
    rng = np.random.default_rng(0)
    occupied, empty = rng.uniform(0.2, 3.0, (2, 6, 9))
    bearings, ranges = np.sort(rng.uniform(-0.3, 0.3, 6)), np.arange(2.0, 11.0)
    found = told_across(occupied, empty, bearings, ranges, 0.8, share)
    if_occupied, if_empty = reference.told_across(occupied, empty, bearings, ranges, 0.8, share)
    assert found[0] == pytest.approx(if_occupied, abs=1e-12)
    assert found[1] == pytest.approx(if_empty, abs=1e-12)


def test_a_lone_ray_hears_nobody() -> None:
    one = np.full((1, 4), 2.0)
    occupied, empty = told_across(one, 0.5 * one, np.zeros(1), np.arange(4.0), 0.9, 1.0)
    assert (occupied == one).all() and (empty == 0.5 * one).all()


@pytest.mark.parametrize("once", [False, True])
def test_cells_change_by_the_likelihood_ratio_and_behind_surfaces_up_to_what_is_expected(once: bool) -> None:
    rng = np.random.default_rng(1)
    values = np.stack([rng.normal(0.0, 3.0, (8, 7)), rng.random((8, 7))], axis=-1)
    told = np.concatenate([rng.uniform(0.1, 5.0, (2, 8, 7)), rng.random((3, 8, 7))])
    told[:, 0] = np.array([1.0, 1.0, 0.0, 0.0, 0.0])[:, None]  # cells that no ray meets
    weight, prior, limit, least = 0.4, -1.2, 4.0, 1e-3
    expected = reference.told_cells(values, told, weight, prior, limit, least, once)
    tell_cells(values, told, weight, prior, limit, least, once)
    assert values == pytest.approx(expected, abs=1e-12)
