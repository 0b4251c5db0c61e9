"""Distances of the cells of a map to the nearest wall."""

from __future__ import annotations

import numpy as np

from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridLayer, OccupancyGrid

OCCUPIED_ABOVE = 0.5


def distance_to_occupied(
    grid: OccupancyGrid, occupied_above: float = OCCUPIED_ABOVE, max_distance_m: float | None = None
) -> GridLayer:
    """Exact Euclidean distances (m), float32 `(rows, cols)`, from each cell's centre to that of the nearest wall cell.

    A wall cell has a probability above `occupied_above`; unknown cells are not walls. Distances are at most `max_distance_m`. On
    a map without walls they are infinite, or `max_distance_m`. Source: Felzenszwalb and Huttenlocher 2012.
    """
    distance_m = distances_to(grid.probability > occupied_above) * np.float32(grid.geometry.resolution_m)
    if max_distance_m is not None:
        distance_m = np.minimum(distance_m, np.float32(max_distance_m))
    return GridLayer(distance_m, grid.geometry)
