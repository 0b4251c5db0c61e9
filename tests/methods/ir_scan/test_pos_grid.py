from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.errors import MethodError
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.methods.ir_scan.pos_grid import PosGrid, probability_of
from gridslam.sensors.infrared import ReliableReadings, reliability, reliable_readings
from tests.methods.ir_scan.room import scan_from


def single(x: float, bel: float = 1.0) -> ReliableReadings:
    return ReliableReadings(
        np.zeros((1, 2)),
        np.array([[x, 0.0]]),
        np.array([[1.0, 0.0]]),
        np.array([x]),
        np.array([bel]),
        np.zeros(1, np.int64),
    )


def test_readings_are_weighted_by_their_reliability_and_summed() -> None:
    pos = PosGrid(0.1, 10.0)
    pose = np.array([0.05, 0.05, 0.0])
    pos.add(single(0.4), pose)
    pos.add(single(0.4, 0.5), pose)
    row, col = pos.grid.cells(np.array([[0.05, 0.05]]))[0]
    assert np.allclose(
        pos.grid.values[row, col : col + 6], 1.5 * np.array([-1, -15 / 16, -12 / 16, -7 / 16, 1, 0])
    )


def test_beams_are_rotated_by_the_pose() -> None:
    pos = PosGrid(0.1, 10.0)
    pos.add(single(0.4), np.array([0.05, 0.05, np.pi / 2]))
    row, col = pos.grid.cells(np.array([[0.05, 0.45]]))[0]
    assert pos.grid.values[row, col] == 1.0
    assert pos.grid.values[row - 4, col] == -1.0


def test_probability_increases_with_pos_and_keeps_the_three_states_of_a_saved_map() -> None:
    pos = np.array([-800.0, -2.0, -1e-6, 0.0, 1e-6, 2.0, 800.0])
    p = probability_of(pos)
    assert np.isnan(p[3])
    known = np.delete(p, 3)
    assert (np.diff(known) >= 0.0).all()
    assert (known[:3] < 0.196).all()
    assert (known[3:] > 0.65).all()
    assert known.min() >= 0.0
    assert known.max() <= 1.0


def test_walls_measured_from_a_stop_are_occupied_and_cells_before_them_are_empty() -> None:
    pose = np.array([0.5, 0.6, 0.0])
    scan = scan_from(pose, np.random.default_rng(0))
    pos = PosGrid(0.01, 50.0)
    pos.add(reliable_readings(scan, reliability(scan, 0.2)), pose)
    wall = pos.grid.cells(np.array([[0.5, 0.001], [0.5, -0.001]]))
    assert pos.grid.values[tuple(wall.T)].max() > 0.0
    before = pos.grid.cells(np.array([[0.5, 0.3], [0.6, 0.4]]))
    assert (pos.grid.values[tuple(before.T)] < 0.0).all()


def test_a_grid_keeps_its_values_when_it_grows_and_has_a_memory_limit() -> None:
    grid = GrowingGrid(0.1, 10.0)
    grid.cover(np.array([[0.05, 0.05]]))
    grid.values[tuple(grid.cells(np.array([[0.05, 0.05]]))[0])] = 7.0
    grid.cover(np.array([[-20.0, 30.0], [25.0, -3.0]]))
    assert grid.values[tuple(grid.cells(np.array([[0.05, 0.05]]))[0])] == 7.0
    assert grid.values.sum() == 7.0
    with pytest.raises(MethodError, match=r"memory_limit_mb"):
        grid.cover(np.array([[0.0, 0.0], [1e6, 1e6]]))
    with pytest.raises(MethodError, match="not finite"):
        grid.cover(np.array([[np.nan, 0.0]]))
