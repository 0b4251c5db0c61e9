"""Sums over beam endpoints against the reference implementation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.kernels.grids.raycast import free_squares
from gridslam.kernels.localization.likelihood_field import (
    BeamCells,
    VisibilityMap,
    sum_over_beams,
    sum_over_offsets,
    sum_over_points,
)
from tests.reference import mcl as reference


def _case(seed):
    rng = np.random.default_rng(seed)
    rows, cols = rng.integers(2, 40, 2)
    field = rng.integers(0, 256, (rows, cols)).astype(np.uint8)
    table = rng.normal(size=256).astype(np.float32)
    points = rng.uniform(-15, 15, (12, 2))
    poses = np.column_stack([rng.uniform(0, cols, 6), rng.uniform(0, rows, 6), rng.uniform(-4, 4, 6)])
    return rng, field, table, points, poses


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_sums_over_points_are_those_of_the_plain_loop(seed):
    _, field, table, points, poses = _case(seed)
    sums = sum_over_points(field, table, points.astype(np.float32), poses)
    for pose, got in zip(poses, sums, strict=True):
        # Single precision may put a point within 1e-5 cells of a grid line on its other side: shift and compare the nearest.
        nearby = [
            reference.sum_over_points(field, table, points, (pose[0] + a, pose[1] + b, pose[2]))
            for a in (0.0, 2e-5, -2e-5)
            for b in (0.0, 2e-5, -2e-5)
        ]
        assert min(abs(got - value) for value in nearby) < 1e-4


def test_points_outside_the_field_take_the_last_entry():
    field = np.zeros((3, 3), np.uint8)
    table = np.arange(256, dtype=np.float32)
    poses = np.array([[-0.5, 1.0, 0.0], [0.5, 1.0, 0.0], [1e9, 0.0, 0.0], [-1e9, 0.0, 0.0]])
    sums = sum_over_points(field, table, np.zeros((1, 2), np.float32), poses)
    np.testing.assert_array_equal(sums, [255.0, 0.0, 255.0, 255.0])


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_blocked_beams_take_the_last_entry(seed):
    rng, field, table, points, poses = _case(seed)
    occupied = rng.random(field.shape) < 0.05
    origins = rng.uniform(-0.5, 0.5, points.shape)
    walls = VisibilityMap(field, free_squares(occupied), 1.5, 0.0)
    sums = sum_over_beams(walls, table, BeamCells(origins, points), poses)
    for pose, got in zip(poses, sums, strict=True):
        total = reference.sum_over_beams(field, occupied, table, BeamCells(origins, points), 1.5, pose)
        assert got == pytest.approx(total, abs=1e-4)


def test_a_beam_that_grazes_a_wall_is_not_blocked_by_it():
    occupied = np.zeros((20, 60), bool)
    occupied[5, 20:] = True
    squares = free_squares(occupied)
    table = np.full(256, 1.0, np.float32)
    table[255] = 0.0
    field = np.zeros((20, 60), np.uint8)
    along = BeamCells(np.array([[5.0, 6.2]]), np.array([[55.0, 5.5]]))
    pose = np.zeros((1, 3))
    assert sum_over_beams(VisibilityMap(field, squares, 4.0, 0.0), table, along, pose)[0] == 0.0
    assert sum_over_beams(VisibilityMap(field, squares, 4.0, 3.0), table, along, pose)[0] == 1.0
    across = BeamCells(np.array([[40.0, 9.0]]), np.array([[42.0, 1.0]]))
    assert sum_over_beams(VisibilityMap(field, squares, 1.0, 3.0), table, across, pose)[0] == 0.0


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_sums_over_offsets_are_sums_of_looked_up_values(seed):
    rng = np.random.default_rng(seed)
    scores = rng.integers(0, 256, 500).astype(np.uint8)
    starts = rng.integers(0, 250, 9).astype(np.int32)
    offsets = rng.integers(0, 250, (4, 7)).astype(np.int32)
    expected = scores.astype(np.int64)[starts[None, :, None] + offsets[:, None, :]].sum(axis=2)
    np.testing.assert_array_equal(sum_over_offsets(scores, starts, offsets), expected)
