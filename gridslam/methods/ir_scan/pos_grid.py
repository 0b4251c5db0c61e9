"""The paper's map (sections 2.7 and 2.8): a grid pos of summed evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared.infrared_beams import add_readings
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.sensors.infrared import ReliableReadings

Floats = NDArray[np.float64]

MIN_OCCUPIED = 0.66  # probability of pos just above 0; above the occupied threshold of a map_server map
MAX_FREE = 0.19  # probability of pos just below 0


class PosGrid:
    """pos of all cells: > 0 occupied, < 0 empty, 0 unknown."""

    def __init__(self, resolution_m: float, memory_limit_mb: float) -> None:
        self.grid = GrowingGrid(resolution_m, memory_limit_mb)

    def add(self, readings: ReliableReadings, pose: Floats) -> None:
        """Add the readings of a stop at T_map_base `(3,)`."""
        origins, points = se2.transform_points(pose, readings.origins), readings.in_map(pose)
        self.grid.cover(np.concatenate([origins, points]))
        add_readings(self.grid.values, self.grid.cells(origins), self.grid.cells(points), readings.bel)

    def layer(self) -> GridLayer:
        """The grid pos."""
        return GridLayer(self.grid.values, self.grid.geometry)

    def occupancy(self) -> OccupancyGrid:
        """The map of probabilities, by `probability_of`."""
        return OccupancyGrid(probability_of(self.grid.values), self.grid.geometry)


def probability_of(pos: Floats) -> NDArray[np.float32]:
    """Probability of occupancy of pos `(rows, cols)`, increasing with it; NaN where pos is 0.

    pos > 0: 1 - 0.34 exp(-pos); pos < 0: 0.19 exp(pos). The step at 0 keeps the paper's three states in a map_server map,
    which has only occupied, free and unknown cells.
    """
    with np.errstate(over="ignore"):
        occupied = 1.0 - (1.0 - MIN_OCCUPIED) * np.exp(-pos)
        free = MAX_FREE * np.exp(pos)
    known = np.where(pos > 0.0, occupied, free)
    return np.where(pos == 0.0, np.nan, known).astype(np.float32)
