from __future__ import annotations

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.floor_cells import FloorCells, FreeFloor


@pytest.mark.parametrize("resolution_m", [0.03, 0.1, 0.7])
@pytest.mark.parametrize("yaw_rad", [0.0, 0.5])
def test_the_floor_in_a_box_is_what_the_free_cells_of_the_map_are_in(
    resolution_m: float, yaw_rad: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gridslam.sensors.floor_cells.CELLS_AT_ONCE", 50)
    probability = np.random.default_rng(4).choice([0.1, 0.9, np.nan], (31, 22)).astype(np.float32)
    grid = OccupancyGrid(probability, GridGeometry(resolution_m, (-1.0, 2.0), yaw_rad))
    floor = FreeFloor(grid, 0.3, 0.1)
    everything = FloorCells.containing(grid.geometry.centres(np.argwhere(probability <= 0.3)), 0.1).unique()
    endless = np.full(2, np.inf)
    assert floor.within(-endless, endless).index.tolist() == everything.index.tolist()
    low, high = np.array([-1.0, 2.0]) - resolution_m, np.array([-1.0, 2.0]) + 9.3 * resolution_m
    assert floor.within(low, high).index.tolist() == everything.within(low, high).index.tolist()
    assert 0 < len(floor.within(low, high)) < len(everything)
    assert len(floor.within(low + 1e9, high + 1e9)) == 0
