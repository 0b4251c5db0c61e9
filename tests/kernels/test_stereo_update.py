"""Neighbouring rays and the cells' update, against versions in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.stereo_update import tell_cells, told_across


@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
def test_neighbouring_rays_pass_messages_through_their_correlation(share: float) -> None:
    rng = np.random.default_rng(0)
    occupied, empty = rng.uniform(0.2, 3.0, (2, 6, 9))
    bearings, ranges = np.sort(rng.uniform(-0.3, 0.3, 6)), np.arange(2.0, 11.0)
    found = told_across(occupied, empty, bearings, ranges, 0.8, share)
    r = 0.8 ** (np.diff(bearings)[:, None] * ranges)
    same, other = 0.5 * (1.0 + r), 0.5 * (1.0 - r)
    if_occupied, if_empty = occupied.copy(), empty.copy()
    for to, source in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
        if_occupied[to] *= (same * occupied[source] + other * empty[source]) ** share
        if_empty[to] *= (other * occupied[source] + same * empty[source]) ** share
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
    change = weight * np.log(told[0] / told[1])
    if once:
        p = np.clip(told[4], least, 1.0 - least)
        room = np.log(p / (1.0 - p)) - prior - values[..., 0]
        at_once = np.clip(room, 0.0, np.maximum(change, 0.0))
        change = np.where(change > 0.0, at_once + told[3] * (change - at_once), change)
    expected = np.clip(values[..., 0] + change, -limit - prior, limit - prior)
    expected[0] = values[0, :, 0]
    seen = np.maximum(values[..., 1], told[2])
    tell_cells(values, told, weight, prior, limit, least, once)
    assert values[..., 0] == pytest.approx(expected, abs=1e-12)
    assert values[..., 1] == pytest.approx(seen, abs=1e-12)
