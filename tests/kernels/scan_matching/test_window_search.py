"""The search of a pose window against one that scores every pose, and rivals in a corridor of equal bays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.scan_matching.window_search import (
    LikelihoodField,
    PoseWindow,
    WindowSearch,
    likelihood_field,
    search_window,
)
from tests.reference.window_search import all_scores

Floats = NDArray[np.float64]

CELL_M = 0.2
SEARCH = WindowSearch(yaw_step_rad=0.05, min_score=0.1, rival_distance_m=1.0, rival_yaw_rad=0.1)


def field_of(points: Floats) -> LikelihoodField:
    corner = points.min(axis=0) - 5.0
    cells = np.ceil((points.max(axis=0) + 5.0 - corner) / CELL_M).astype(np.int64)
    field: LikelihoodField = likelihood_field(points, corner, cells, CELL_M, 0.15)
    return field


def test_the_best_pose_and_its_rival_are_those_of_the_full_search() -> None:
    rng = np.random.default_rng(3)
    for _ in range(3):
        surface = rng.uniform(-4.0, 4.0, (60, 2))
        field = field_of(surface)
        points = surface[:40] + rng.normal(0.0, 0.05, (40, 2))
        window = PoseWindow(rng.uniform(-0.8, 0.8, 3) * [1.0, 1.0, 0.1], np.array([2.1, 1.3, 0.12]))
        poses, scores = all_scores(field, points, window, SEARCH)
        found = search_window(field, points, window, SEARCH)
        np.testing.assert_allclose(found.score, scores.max())
        best = int(np.argmin(np.abs(poses - found.pose).sum(axis=1)))
        np.testing.assert_allclose(scores[best], scores.max())
        offset = np.abs(poses - found.pose)
        away = (offset[:, :2] > SEARCH.rival_distance_m + 1e-9).any(axis=1)
        away |= offset[:, 2] > SEARCH.rival_yaw_rad + 1e-9
        expected = scores[away].max()
        if expected > 0.5 * found.score:
            np.testing.assert_allclose(found.rival_score, expected)


def test_nothing_is_found_where_nothing_fits() -> None:
    field = field_of(np.zeros((1, 2)))
    points = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 2))
    window = PoseWindow(np.zeros(3), np.array([0.5, 0.5, 0.1]))
    found = search_window(field, points, window, SEARCH)
    assert found.score == found.rival_score == -1.0


def bays(count: int) -> Floats:
    """Walls with a niche every three metres."""
    x = np.arange(0.0, 3.0 * count, 0.1)
    depth = np.where(x % 3.0 < 1.0, 0.4, 0.0)
    return np.concatenate([np.stack([x, 1.0 + depth], axis=1), np.stack([x, -1.0 - depth], axis=1)])


def test_a_corridor_of_equal_bays_has_a_rival_as_good_as_the_best_pose() -> None:
    corridor = bays(8)
    middle = corridor[(corridor[:, 0] > 9.0) & (corridor[:, 0] < 15.0)]
    window = PoseWindow(np.zeros(3), np.array([4.0, 0.5, 0.05]))
    found = search_window(field_of(corridor), middle, window, SEARCH)
    assert found.rival_score > 0.95 * found.score


def test_a_window_of_less_than_a_bay_has_no_such_rival() -> None:
    corridor = bays(8)
    middle = corridor[(corridor[:, 0] > 9.0) & (corridor[:, 0] < 15.0)]
    window = PoseWindow(np.zeros(3), np.array([1.4, 0.5, 0.05]))
    found = search_window(field_of(corridor), middle, window, SEARCH)
    np.testing.assert_allclose(found.pose, 0.0, atol=1e-9)
    assert found.rival_score < 0.85 * found.score
