from __future__ import annotations

import math

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.grid_frame import poses_in_cells
from gridslam.sensors.likelihood_field import distance_field, log_likelihood_table, occupied_cells

ROTATED = GridGeometry(0.1, (-2.0, 3.0), 0.4)


def test_unknown_cells_are_not_walls():
    probability = np.array([[np.nan, 0.9, 0.64, 0.1]], np.float32)
    grid = OccupancyGrid(probability, GridGeometry(1.0, (0.0, 0.0)))
    assert occupied_cells(grid, 0.65).tolist() == [[False, True, False, False]]


def test_distances_are_those_between_cell_centres_to_half_a_step():
    occupied = np.zeros((30, 40), bool)
    occupied[12, 7] = occupied[25, 30] = True
    field = distance_field(occupied, GridGeometry(0.1, (0.0, 0.0)), 2.0)
    rows, cols = np.mgrid[:30, :40]
    exact = np.minimum(np.hypot(rows - 12, cols - 7), np.hypot(rows - 25, cols - 30)) * 0.1
    step = 2.0 / 255
    assert np.abs(field.distances_m[field.steps] - np.minimum(exact, 2.0)).max() <= 0.5 * step + 1e-9


def test_a_map_without_walls_is_far_everywhere():
    field = distance_field(np.zeros((3, 3), bool), GridGeometry(0.1, (0.0, 0.0)), 1.5)
    assert field.distances_at(np.zeros((1, 2)), np.array([0.1, 0.1, 0.0])) == pytest.approx(1.5)


def test_sums_on_a_rotated_map_are_those_of_the_points_in_its_cells():
    rng = np.random.default_rng(5)
    occupied = rng.random((50, 60)) < 0.02
    field = distance_field(occupied, ROTATED, 2.0)
    points = rng.uniform(-1.5, 1.5, (30, 2))
    poses = np.column_stack([ROTATED.centres(rng.integers(10, 40, (20, 2))), rng.uniform(-3, 3, 20)])
    table = field.distances_m.astype(np.float32)
    sums = field.table_sums(table, points, poses)
    for pose, got in zip(poses, sums, strict=True):
        cells = ROTATED.cells(se2.transform_points(pose, points))
        # The nearest grid line is far enough from every point for single precision to be enough.
        expected = sum(_value(field, cell) for cell in cells)
        assert got == pytest.approx(expected, abs=0.12)


def _value(field, cell):
    rows, cols = field.steps.shape
    inside = 0 <= cell[0] < rows and 0 <= cell[1] < cols
    return field.distances_m[field.steps[cell[0], cell[1]] if inside else 255]


def test_the_grids_own_corner_is_the_origin_in_cells():
    corner = np.array([[-2.0, 3.0, 0.4]])
    np.testing.assert_allclose(poses_in_cells(ROTATED, corner), [[0.0, 0.0, 0.0]], atol=1e-12)
    ahead = se2.compose(corner, np.array([1.0, 0.5, 0.1]))
    np.testing.assert_allclose(poses_in_cells(ROTATED, ahead), [[10.0, 5.0, 0.1]], atol=1e-9)


def test_the_table_is_the_mixture_of_a_gaussian_and_chance():
    field = distance_field(np.eye(3, dtype=bool), GridGeometry(0.1, (0.0, 0.0)), 2.0)
    table = log_likelihood_table(field, 0.2, 0.1)
    assert table[0] == pytest.approx(0.0)
    assert table[255] == pytest.approx(math.log(0.1))
    distance = 30 * 2.0 / 255
    assert table[30] == pytest.approx(math.log(0.9 * math.exp(-0.5 * (distance / 0.2) ** 2) + 0.1), rel=1e-5)


def test_a_large_field_made_band_by_band_is_that_of_the_whole_map(monkeypatch):
    occupied = np.random.default_rng(2).random((90, 40)) < 0.004
    whole = distance_field(occupied, ROTATED, 1.0).steps
    monkeypatch.setattr("gridslam.sensors.likelihood_field.CELLS_AT_ONCE", 40 * 25)
    np.testing.assert_array_equal(distance_field(occupied, ROTATED, 1.0).steps, whole)
