"""Ray casting by free squares against the traversal cell by cell."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.grids.raycast import FLAT, cast_rays, free_boxes, free_squares
from tests.reference.ray_traversal import cast_cell_by_cell, largest_free_square


@settings(max_examples=150, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 40),
    st.integers(1, 40),
    st.sampled_from([0.0, 0.01, 0.1, 0.4]),
    st.floats(1.0, 80.0),
)
def test_ranges_are_those_of_the_traversal_cell_by_cell(seed, rows, cols, density, max_range):
    rng = np.random.default_rng(seed)
    occupied = rng.random((rows, cols)) < density
    poses = np.column_stack(
        [rng.uniform(-1, cols + 1, 8), rng.uniform(-1, rows + 1, 8), rng.uniform(-4, 4, 8)]
    )
    bearings = rng.uniform(-math.pi, math.pi, 5)
    ranges = cast_rays(free_squares(occupied), poses, bearings, max_range)
    np.testing.assert_array_equal(ranges, cast_rays(free_boxes(occupied), poses, bearings, max_range))
    for pose, row in zip(poses, ranges, strict=True):
        for bearing, measured in zip(bearings, row, strict=True):
            expected, _ = cast_cell_by_cell(occupied, pose[0], pose[1], pose[2] + bearing, max_range)
            assert abs(measured - expected) < 1e-4 * max(1.0, expected)


def test_rays_along_the_axes_hit_the_face_of_the_cell():
    occupied = np.zeros((21, 31), bool)
    occupied[10, 25] = occupied[10, 2] = occupied[18, 12] = occupied[1, 12] = True
    bearings = np.array([0.0, math.pi, math.pi / 2, -math.pi / 2])
    ranges = cast_rays(free_squares(occupied), np.array([[12.5, 10.5, 0.0]]), bearings, 100.0)
    np.testing.assert_allclose(ranges[0], [12.5, 9.5, 7.5, 8.5], atol=1e-5)


def test_a_ray_that_starts_in_a_wall_has_range_0_and_one_that_leaves_the_grid_the_maximum_range():
    occupied = np.zeros((5, 5), bool)
    occupied[2, 2] = True
    squares = free_squares(occupied)
    assert cast_rays(squares, np.array([[2.5, 2.5, 1.0]]), np.zeros(1), 9.0)[0, 0] == 0.0
    assert cast_rays(squares, np.array([[4.5, 4.5, 0.5]]), np.zeros(1), 9.0)[0, 0] == 9.0
    assert cast_rays(squares, np.array([[-3.0, 2.5, 0.0]]), np.zeros(1), 9.0)[0, 0] == 9.0


@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 12))
@settings(max_examples=50, deadline=None)
def test_free_squares_are_free_and_the_largest(seed, rows, cols):
    occupied = np.random.default_rng(seed).random((rows, cols)) < 0.15
    squares = free_squares(occupied)
    for quadrant in range(4):
        for r in range(rows):
            for c in range(cols):
                assert squares[quadrant, r, c] == largest_free_square(occupied, r, c, quadrant)


@given(st.integers(0, 2**32 - 1), st.integers(1, 14), st.integers(1, 14))
@settings(max_examples=50, deadline=None)
def test_free_boxes_are_free_and_the_largest_of_their_shape(seed, rows, cols):
    occupied = np.random.default_rng(seed).random((rows, cols)) < 0.1
    boxes = free_boxes(occupied)
    np.testing.assert_array_equal(boxes[:4], free_squares(occupied))
    for plane in range(4, 12):
        high, wide = (1, FLAT) if plane < 8 else (FLAT, 1)
        for r in range(rows):
            for c in range(cols):
                side = boxes[plane, r, c]
                assert _is_free(occupied, (r, c), plane % 4, (side * high, side * wide))
                assert not _is_free(occupied, (r, c), plane % 4, ((side + 1) * high, (side + 1) * wide))


def _is_free(occupied, corner, quadrant, size):
    """Whether a box of `size` cells (rows, columns) with the cell in its corner is free and in the grid."""
    r, c = (np.arange(n) * (-1 if back else 1) for n, back in zip(size, divmod(quadrant, 2), strict=True))
    r, c = r + corner[0], c + corner[1]
    inside = all(((k >= 0) & (k < n)).all() for k, n in zip((r, c), occupied.shape, strict=True))
    return inside and not occupied[np.ix_(r, c)].any()
