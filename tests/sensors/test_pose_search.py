from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.likelihood_field import distance_field, log_likelihood_table, occupied_cells
from gridslam.sensors.pose_search import PoseSearch, PoseSearchSettings, _widest_cells
from tests.methods.ispace_mcl.building import BEAMS, LIDAR, building, scan_at

SETTINGS = PoseSearchSettings(
    spacing_m=0.3,
    headings=120,
    sigma_m=0.3,
    points=64,
    max_poses=3_000_000,
    refined=2000,
    hypotheses=200,
    bin_m=0.5,
    bin_rad=0.26,
)
POSES = [(-1.5, 3.8, 0.3), (-0.5, 6.5, 2.0), (5.8, 6.4, -1.0), (4.5, 3.6, 3.1)]


def _points(grid, pose):
    """Endpoints in the robot's frame of a scan from a pose."""
    ranges = scan_at(grid, grid.probability > 0.5, np.array(pose))
    angles = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + LIDAR[:2]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("map_yaw", [0.0, 0.7])
def test_the_best_hypothesis_is_where_the_scan_was_taken(pose, map_yaw):
    grid = building()
    origin = se2.compose([0.0, 0.0, map_yaw], [*grid.geometry.origin_xy_m, 0.0])
    geometry = GridGeometry(grid.geometry.resolution_m, (float(origin[0]), float(origin[1])), map_yaw)
    field = distance_field(occupied_cells(grid, 0.65), geometry, 2.0)
    search = PoseSearch(field, grid.probability < 0.3, SETTINGS)
    found = search.search(_points(grid, pose), log_likelihood_table(field, 0.2, 0.1))
    off = found.poses[0] - se2.compose([0.0, 0.0, map_yaw], pose)
    assert np.hypot(off[0], off[1]) < 0.1
    assert abs(se2.wrap_angle(off[2])) < 0.03
    assert np.all(np.diff(found.scores) <= 0.0)


def test_a_bound_on_the_poses_makes_the_search_coarser_not_smaller():
    grid = building()
    field = distance_field(occupied_cells(grid, 0.65), grid.geometry, 2.0)
    coarse = replace(SETTINGS, max_poses=20_000)
    search = PoseSearch(field, grid.probability < 0.3, coarse)
    found = search.search(_points(grid, POSES[1]), log_likelihood_table(field, 0.2, 0.1))
    assert np.hypot(*(found.poses[0, :2] - POSES[1][:2])) < 0.3  # the spacing is 0.75 m then


@pytest.mark.parametrize(("stride", "shape"), [(1, (7, 9)), (4, (17, 9)), (30, (17, 9))])
def test_of_every_square_with_free_cells_the_widest_one_is_a_position(stride, shape):
    clearance = np.random.default_rng(3).integers(-20, 30, shape).clip(0).astype(np.int16)
    expected = []
    for row in range(0, shape[0], stride):
        for col in range(0, shape[1], stride):
            square = clearance[row : row + stride, col : col + stride]
            if square.any():
                inside = np.unravel_index(square.argmax(), square.shape)
                expected.append([row + inside[0], col + inside[1]])
    assert _widest_cells(clearance, stride).tolist() == expected


def test_a_large_map_is_searched_as_if_it_were_taken_whole(monkeypatch):
    grid = building()
    field = distance_field(occupied_cells(grid, 0.65), grid.geometry, 2.0)
    coarse = replace(SETTINGS, max_poses=20_000)
    whole = PoseSearch(field, grid.probability < 0.3, coarse)
    monkeypatch.setattr("gridslam.sensors.pose_search.CELLS_AT_ONCE", 500)
    in_bands = PoseSearch(field, grid.probability < 0.3, coarse)
    np.testing.assert_array_equal(in_bands._positions, whole._positions)
    np.testing.assert_array_equal(in_bands._coarse_scores, whole._coarse_scores)
