"""Branch and bound against the exhaustive search."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.scan_matching import correlative_matching
from gridslam.kernels.scan_matching.correlative_matching import FieldPyramid, SearchWindow
from tests.reference import correlative_matching as reference

LEVELS, MARGIN = 3, 8


@given(seed=st.integers(0, 10_000), window=st.integers(0, 5), yaw_steps=st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_branch_and_bound_finds_the_score_of_the_exhaustive_search(
    seed: int, window: int, yaw_steps: int
) -> None:
    rng = np.random.default_rng(seed)
    field = np.zeros((40, 44), np.uint8)
    field[MARGIN:-MARGIN, MARGIN:-MARGIN] = rng.integers(0, 256, (40 - 2 * MARGIN, 44 - 2 * MARGIN))
    points = rng.uniform(-1.0, 1.0, (15, 2))
    origin, start = np.array([-2.2, -2.0]), rng.uniform(-0.3, 0.3, 3)
    pyramid = FieldPyramid(correlative_matching.field_pyramid(field, LEVELS), origin, 0.1)
    search = SearchWindow(0.1 * window, 0.05, yaw_steps)
    pose, score = correlative_matching.correlate(pyramid, points, start, search, 0.0)
    best = reference.correlate(field, origin, 0.1, points, start, 0.1 * window, 0.05, yaw_steps)
    assert abs(score - max(best, 0.0)) < 1e-9 or (score == -1.0 and best <= 0.0)
    at_pose = reference.correlate(field, origin, 0.1, points, pose, 0.0, 0.05, 0)
    assert abs(at_pose - score) <= 255.0 / len(points)  # a point on a cell's border may fall to either side


def test_a_level_of_the_pyramid_is_the_maximum_of_its_block() -> None:
    field = np.random.default_rng(1).integers(0, 256, (20, 23)).astype(np.uint8)
    pyramid = correlative_matching.field_pyramid(field, LEVELS)
    for level in range(LEVELS):
        np.testing.assert_array_equal(pyramid[level], reference.field_level(field, level))


def test_poses_below_the_minimum_score_are_not_found() -> None:
    levels = correlative_matching.field_pyramid(np.full((20, 20), 10, np.uint8), LEVELS)
    start = np.array([0.1, 0.2, 0.3])
    pose, score = correlative_matching.correlate(
        FieldPyramid(levels, np.array([-1.0, -1.0]), 0.1),
        np.zeros((4, 2)),
        start,
        SearchWindow(0.2, 0.05, 1),
        128.0,
    )
    assert score == -1.0
    np.testing.assert_array_equal(pose, start)
