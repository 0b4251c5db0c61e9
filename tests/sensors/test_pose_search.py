from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry
from gridslam.sensors.likelihood_field import distance_field, log_likelihood_table, occupied_cells
from gridslam.sensors.pose_search import PoseSearch, SearchSettings
from tests.methods.ispace_mcl.building import BEAMS, LIDAR, building, scan_at

SETTINGS = SearchSettings(0.3, 120, 0.3, 64, 3_000_000, 2000, 200, 0.5, 0.26)
POSES = [(-1.5, 3.8, 0.3), (-0.5, 6.5, 2.0), (5.8, 6.4, -1.0), (4.5, 3.6, 3.1)]


def _points(grid, pose):
    """End points in the robot's frame of what the lidar sees from a pose."""
    ranges = scan_at(grid, grid.probability > 0.5, np.array(pose))
    angles = -np.pi + 2.0 * np.pi / BEAMS * np.arange(BEAMS)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + LIDAR[:2]


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_best_hypothesis_is_where_the_scan_was_taken(pose, turn):
    grid = building()
    origin = se2.compose([0.0, 0.0, turn], [*grid.geometry.origin_xy_m, 0.0])
    geometry = GridGeometry(grid.geometry.resolution_m, (float(origin[0]), float(origin[1])), turn)
    field = distance_field(occupied_cells(grid, 0.65), geometry, 2.0)
    search = PoseSearch(field, grid.probability < 0.3, SETTINGS)
    found = search.best(_points(grid, pose), log_likelihood_table(field, 0.2, 0.1))
    off = found.poses[0] - se2.compose([0.0, 0.0, turn], pose)
    assert np.hypot(off[0], off[1]) < 0.1
    assert abs(se2.wrap_angle(off[2])) < 0.03
    assert np.all(np.diff(found.scores) <= 0.0)


def test_a_bound_on_the_poses_makes_the_search_coarser_not_smaller():
    grid = building()
    field = distance_field(occupied_cells(grid, 0.65), grid.geometry, 2.0)
    coarse = SearchSettings(0.3, 120, 0.3, 64, 20_000, 2000, 200, 0.5, 0.26)
    search = PoseSearch(field, grid.probability < 0.3, coarse)
    found = search.best(_points(grid, POSES[1]), log_likelihood_table(field, 0.2, 0.1))
    assert np.hypot(*(found.poses[0, :2] - POSES[1][:2])) < 0.3  # places are 0.75 m apart then
