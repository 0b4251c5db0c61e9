"""The finished map: one dense grid from key scans and their poses."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.errors import MethodError
from gridslam.lidar_slam.grid_map import draw_map
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.slam_sd.config import MapConfig

RESOLUTION_M = 0.1
CONFIG = MapConfig()


def scan(*returns: tuple[float, float]) -> PreparedScan:
    none = np.zeros((0, 2))
    return PreparedScan(0, np.zeros(2), np.array(returns).reshape(-1, 2), none, none, none, none)


def at(grid: OccupancyGrid, x: float, y: float) -> float:
    row, col = grid.geometry.cells(np.array([[x, y]]))[0]
    return float(grid.probability[row, col])


def draw(
    scans: list[PreparedScan], poses: np.ndarray, explained: list[np.ndarray] | None = None
) -> OccupancyGrid:
    return draw_map(scans, poses, RESOLUTION_M, CONFIG, 100.0, explained)


def test_end_points_are_occupied_the_way_there_is_free_the_rest_unknown() -> None:
    grid = draw([scan((2.05, 0.0))], np.array([[0.0, 0.05, 0.0]]))
    assert at(grid, 2.05, 0.05) == pytest.approx(1.0 / (1.0 + np.exp(-CONFIG.hit)))
    assert at(grid, 1.05, 0.05) == pytest.approx(1.0 / (1.0 + np.exp(-CONFIG.miss)))
    assert np.isnan(at(grid, 2.25, 0.05))


def test_scans_are_placed_by_their_poses() -> None:
    grid = draw([scan((1.05, 0.0))] * 2, np.array([[0.05, 0.05, 0.0], [0.05, 0.05, np.pi / 2]]))
    assert at(grid, 1.1, 0.05) > 0.5
    assert at(grid, 0.05, 1.1) > 0.5


def test_what_something_else_explains_leaves_no_mark_at_its_end_and_free_space_before_it() -> None:
    poses = np.array([[0.05, 0.05, 0.0]])
    grid = draw([scan((2.0, 0.0), (0.0, 2.0))], poses, [np.array([True, False])])
    assert np.isnan(at(grid, 2.05, 0.05))
    assert at(grid, 1.75, 0.05) < 0.5
    assert at(grid, 0.05, 2.05) > 0.5


def test_no_scan_gives_an_empty_map_and_a_path_gone_astray_an_error() -> None:
    assert draw([], np.zeros((0, 3))).probability.size == 0
    with pytest.raises(MethodError, match=r"method\.memory_limit_mb"):
        draw([scan((1.0, 0.0))] * 2, np.array([[0.0, 0, 0], [1e5, 1e5, 0.0]]))
