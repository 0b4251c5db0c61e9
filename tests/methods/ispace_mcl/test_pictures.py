from __future__ import annotations

import numpy as np
import pytest

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.ispace_mcl.cameras.pictures import FloorCounts
from gridslam.sensors.floor_cells import FloorCells


@pytest.mark.parametrize("resolution_m", [0.02, 0.05, 0.3])
def test_floor_cells_are_counted_on_the_map_cells_about_their_centres(
    resolution_m: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gridslam.methods.ispace_mcl.cameras.pictures.CELLS_AT_ONCE", 60)
    rng = np.random.default_rng(0)
    grid = OccupancyGrid(np.zeros((29, 23), np.float32), GridGeometry(resolution_m, (-0.3, 0.2), 0.3))
    cells = FloorCells(rng.integers(-8, 12, (200, 2)), 0.1)
    half_width = int(0.1 / resolution_m / 2.0)
    expected = np.zeros(grid.probability.shape, np.int64)
    for row, col in grid.geometry.cells(cells.centres):
        for r in range(max(row - half_width, 0), min(row + half_width + 1, 29)):
            for c in range(max(col - half_width, 0), min(col + half_width + 1, 23)):
                expected[r, c] += 1
    counts = FloorCounts.of(grid, cells)
    assert expected.any()
    np.testing.assert_array_equal(np.concatenate(list(counts.in_bands())), expected)
    np.testing.assert_array_equal(counts.part(slice(3, 20), slice(5, 9)), expected[3:20, 5:9])
