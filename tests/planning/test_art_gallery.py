"""Observation points (handmap-slam, paper section 3.1) against the minimum cover."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.planning.art_gallery import choose_observation_points, gallery_of, greedy_cover, scatter
from tests.reference.planning import minimum_cover


def drawing(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A hall with random walls across it."""
    rng = np.random.default_rng(seed)
    walls = np.ones((30, 40), bool)
    walls[1:-1, 1:-1] = False
    for _ in range(6):
        r, c, length = rng.integers(3, 27), rng.integers(3, 37), rng.integers(5, 15)
        if rng.random() < 0.5:
            walls[r, c : c + length] = True
        else:
            walls[r : r + length, c] = True
    return walls, ~walls


@pytest.mark.parametrize("seed", range(5))
def test_the_greedy_cover_covers_all_coverable_walls_within_its_bound(seed: int) -> None:
    walls, free = drawing(seed)
    gallery = gallery_of(walls, free)
    candidates = scatter(free, 60, np.random.default_rng(seed))
    visible = gallery.visible_from(candidates, 15.0)
    chosen = greedy_cover(visible)
    assert (visible[chosen].any(axis=0) == visible.any(axis=0)).all()
    smallest = minimum_cover(visible)
    largest = int(visible.sum(axis=1).max())
    assert smallest <= len(chosen) <= (np.log(largest) + 1.0) * smallest  # Chvatal 1979


def test_every_chosen_point_adds_walls() -> None:
    walls, free = drawing(7)
    points = choose_observation_points(gallery_of(walls, free), free, 15.0, 80, np.random.default_rng(0))
    seen = np.zeros(points.visible.shape[1], bool)
    for row in points.visible:
        assert (row & ~seen).any()
        seen |= row


def test_walls_visible_from_no_candidate_are_reported() -> None:
    walls, free = drawing(2)
    standable = np.zeros_like(free)
    standable[2:6, 2:6] = free[2:6, 2:6]
    points = choose_observation_points(gallery_of(walls, free), standable, 5.0, 50, np.random.default_rng(0))
    assert points.uncoverable.any()
    assert not (points.uncoverable & points.visible.any(axis=0)).any()


def test_the_same_seed_gives_the_same_points() -> None:
    walls, free = drawing(3)
    a, b = (
        choose_observation_points(gallery_of(walls, free), free, 12.0, 70, np.random.default_rng(5)).points
        for _ in range(2)
    )
    np.testing.assert_array_equal(a, b)
