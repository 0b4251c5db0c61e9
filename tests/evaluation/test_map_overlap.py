"""Two maps are laid on each other where walls and free space of both agree, and not where walls alone do."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.evaluation.map_overlap import register_overlapping
from gridslam.maps.editing import moved
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

CELL_M = 0.1
T_NEW_OLD = np.array([4.0, -7.0, 0.8])


def building(seed: int) -> OccupancyGrid:
    """A row of twelve rooms of different widths along a corridor, with doors and boxes in places of their own."""
    rng = np.random.default_rng(seed)
    cols = np.cumsum([0, *rng.integers(25, 45, 12)])
    values = np.full((90, int(cols[-1]) + 1), 0.05, np.float32)
    values[[0, 29, 60, 89]] = 0.95
    values[:, [0, -1]] = 0.95
    for left, right in zip(cols[:-1].tolist(), cols[1:].tolist(), strict=True):
        for rows, door_row in ((slice(0, 30), 29), (slice(60, 90), 60)):
            values[rows, right] = 0.95
            door = left + int(rng.integers(3, right - left - 12))
            values[door_row, door : door + 9] = 0.05
            row, col = rows.start + int(rng.integers(4, 18)), left + int(rng.integers(3, right - left - 9))
            values[row : row + 6, col : col + 5] = 0.95
    return OccupancyGrid(values, GridGeometry(CELL_M, (-2.0, 1.0)))


def part(grid: OccupancyGrid, low: float, high: float) -> OccupancyGrid:
    """The columns between two fractions of the width."""
    cols = slice(*(round(f * grid.probability.shape[1]) for f in (low, high)))
    x, y = grid.geometry.origin_xy_m
    return OccupancyGrid(grid.probability[:, cols], GridGeometry(CELL_M, (x + cols.start * CELL_M, y)))


def test_maps_that_overlap_by_a_third_are_laid_on_each_other() -> None:
    whole = building(0)
    found = register_overlapping(moved(part(whole, 0.35, 1.0), T_NEW_OLD), part(whole, 0.0, 0.65))
    assert found is not None and found.is_reliable
    error = se2.compose(found.T_base_other, T_NEW_OLD)
    assert np.hypot(*error[:2]) < 0.15 and abs(error[2]) < 0.01


def test_maps_without_a_common_room_are_not_laid_on_each_other() -> None:
    whole, elsewhere = building(0), building(1)
    for other in (part(whole, 0.65, 1.0), elsewhere):
        found = register_overlapping(moved(other, T_NEW_OLD), part(whole, 0.0, 0.6))
        assert found is not None and not found.is_reliable


def test_a_map_without_walls_lies_nowhere() -> None:
    empty = OccupancyGrid(np.full((20, 20), 0.05, np.float32), GridGeometry(CELL_M, (0.0, 0.0)))
    assert register_overlapping(empty, building(0)) is None
