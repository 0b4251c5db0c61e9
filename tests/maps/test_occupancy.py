from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid, values_under


@pytest.mark.parametrize("yaws", [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, -1.0)])
def test_values_are_those_of_the_cells_under_the_centres_of_another_grid(
    yaws: tuple[float, float, float],
) -> None:
    rng = np.random.default_rng(0)
    grid = OccupancyGrid(rng.random((17, 23)).astype(np.float32), GridGeometry(0.1, (-0.4, 0.3), yaws[0]))
    other, pose = GridGeometry(0.07, (-0.9, -0.2), yaws[1]), np.array([0.11, -0.23, yaws[2]])
    values = values_under(grid, pose, other, (slice(3, 30), slice(2, 45)))
    for r, row in enumerate(values, start=3):
        for c, value in enumerate(row, start=2):
            y, x = grid.geometry.cells(se2.transform_points(pose, other.centres(np.array([[r, c]]))))[0]
            expected = grid.probability[y, x] if 0 <= y < 17 and 0 <= x < 23 else np.nan
            np.testing.assert_array_equal(value, expected)
    assert 0 < np.isnan(values).sum() < values.size
    assert values_under(grid, pose, other, (slice(3, 3), slice(2, 4))).shape == (0, 2)
