"""The final map: one dense grid from key scans and their poses."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.errors import MethodError
from gridslam.lidar_slam.grid_map import UPDATE, LastUpdates, draw_map
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import OccupancyGrid

RESOLUTION_M = 0.1


def scan(*returns: tuple[float, float]) -> PreparedScan:
    none = np.zeros((0, 2))
    return PreparedScan(0, np.zeros(2), np.array(returns).reshape(-1, 2), none, none, none, none)


def at(grid: OccupancyGrid, x: float, y: float) -> float:
    row, col = grid.geometry.cells(np.array([[x, y]]))[0]
    return float(grid.probability[row, col])


def draw(
    scans: list[PreparedScan], poses: np.ndarray, masked: list[np.ndarray] | None = None
) -> OccupancyGrid:
    return draw_map(scans, poses, RESOLUTION_M, 100.0, masked)


def test_endpoints_are_occupied_crossed_cells_free_and_the_rest_unknown() -> None:
    grid = draw([scan((2.05, 0.0))], np.array([[0.0, 0.05, 0.0]]))
    assert at(grid, 2.05, 0.05) == pytest.approx(1.0 / (1.0 + np.exp(-UPDATE.hit)))
    assert at(grid, 1.05, 0.05) == pytest.approx(1.0 / (1.0 + np.exp(-UPDATE.miss)))
    assert np.isnan(at(grid, 2.25, 0.05))


def test_scans_are_placed_by_their_poses() -> None:
    grid = draw([scan((1.05, 0.0))] * 2, np.array([[0.05, 0.05, 0.0], [0.05, 0.05, np.pi / 2]]))
    assert at(grid, 1.1, 0.05) > 0.5
    assert at(grid, 0.05, 1.1) > 0.5


def test_a_masked_return_frees_its_beam_and_marks_nothing_at_its_endpoint() -> None:
    poses = np.array([[0.05, 0.05, 0.0]])
    grid = draw([scan((2.0, 0.0), (0.0, 2.0))], poses, [np.array([True, False])])
    assert np.isnan(at(grid, 2.05, 0.05))
    assert at(grid, 1.75, 0.05) < 0.5
    assert at(grid, 0.05, 2.05) > 0.5


def test_no_scan_gives_an_empty_map_and_a_pose_far_away_an_error() -> None:
    assert draw([], np.zeros((0, 3))).probability.size == 0
    with pytest.raises(MethodError, match="memory_limit_mb = "):
        draw([scan((1.0, 0.0))] * 2, np.array([[0.0, 0, 0], [1e5, 1e5, 0.0]]))


def test_no_cell_has_the_number_of_the_next_scan_however_many_scans_there_were() -> None:
    last = LastUpdates(1, 300)
    for scan in range(300):
        number = last.next_scan()
        assert number > 0
        assert not (last.numbers == number).any()
        last.numbers[0, scan] = number
