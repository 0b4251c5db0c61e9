"""Values of a map under points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid


def sample(grid: OccupancyGrid, points_xy: NDArray[np.float64]) -> NDArray[np.float32]:
    """Probabilities `(n,)` of the cells that contain the points `(n, 2)` (m, map frame); NaN outside the grid."""
    cells = grid.geometry.cells(points_xy)
    inside = ((cells >= 0) & (cells < grid.probability.shape)).all(axis=1)
    values = np.full(len(cells), np.nan, np.float32)
    values[inside] = grid.probability[cells[inside, 0], cells[inside, 1]]
    return values
