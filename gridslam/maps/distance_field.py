"""The distance from every cell of a map to the nearest wall."""

from __future__ import annotations

import numpy as np

from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridLayer, OccupancyGrid

OCCUPIED_FROM = 0.5


def distance_to_occupied(
    grid: OccupancyGrid, occupied_from: float = OCCUPIED_FROM, max_distance_m: float | None = None
) -> GridLayer:
    """Exact Euclidean distance (m), float32 `(rows, cols)`, between a cell's centre and that of the nearest wall.

    A wall cell has a probability > `occupied_from`; unknown cells are none. `max_distance_m` cuts larger distances
    off. In a map without walls the distance is infinite, or `max_distance_m`.
    Source: Felzenszwalb and Huttenlocher 2012, as OpenCV's precise distance transform.
    """
    distance_m = distances_to(grid.probability > occupied_from) * np.float32(grid.geometry.resolution_m)
    if max_distance_m is not None:
        distance_m = np.minimum(distance_m, np.float32(max_distance_m))
    return GridLayer(distance_m, grid.geometry)
