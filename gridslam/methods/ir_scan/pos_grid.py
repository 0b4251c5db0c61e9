"""The paper's map (sections 2.7 and 2.8): a grid pos of summed evidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.infrared import add_readings
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.sensors.infrared import BeamEnds

Floats = NDArray[np.float64]

_LEAST_OCCUPIED = 0.66  # above the threshold of a map_server map, so that pos > 0 is a wall there as well
_MOST_FREE = 0.19


class PosGrid:
    """pos of all cells: > 0 occupied, < 0 empty, 0 unknown."""

    def __init__(self, resolution_m: float, memory_limit_mb: float) -> None:
        self.grid = GrowingGrid(resolution_m, memory_limit_mb)

    def add(self, ends: BeamEnds, pose: Floats) -> None:
        """Take in the reliable readings of a stop at a pose `(3,)`."""
        starts, points = se2.transform_points(pose, ends.origins), ends.in_map(pose)
        self.grid.cover(np.concatenate([starts, points]))
        add_readings(self.grid.values, self.grid.cells(starts), self.grid.cells(points), ends.bel)

    def layer(self) -> GridLayer:
        """The raw grid."""
        return GridLayer(self.grid.values, self.grid.geometry)

    def occupancy(self) -> OccupancyGrid:
        """The probability map made of pos by `probability_of`."""
        return OccupancyGrid(probability_of(self.grid.values), self.grid.geometry)


def probability_of(pos: Floats) -> NDArray[np.float32]:
    """Probability of occupancy of pos, growing with it; NaN where pos is 0.

    pos > 0: 1 - 0.34 exp(-pos); pos < 0: 0.19 exp(pos). The step at 0 lets a map_server map, which knows occupied, free
    and unknown only, keep the paper's three states.
    """
    with np.errstate(over="ignore"):
        occupied = 1.0 - (1.0 - _LEAST_OCCUPIED) * np.exp(-pos)
        free = _MOST_FREE * np.exp(pos)
    known = np.where(pos > 0.0, occupied, free)
    return np.where(pos == 0.0, np.nan, known).astype(np.float32)
