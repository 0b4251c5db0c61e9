"""The true map: static shapes are occupied, cells that the robot can reach are free, all others unknown."""

from __future__ import annotations

from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.simulation.geometry import Array
from gridslam.simulation.scene import Scene
from gridslam.simulation.world_config import TruthMap

SAMPLES_PER_CELL = 5
MAX_CELLS = 100_000_000


def true_map(scene: Scene, config: TruthMap) -> OccupancyGrid:
    """The static map. Doors and movable objects are excluded; they are in objects.csv.

    Raises ConfigError: the map would have too many cells.
    """
    segments, circles = scene.static_segments, scene.cylinders
    centres, radii = circles[:, :2], circles[:, 2:]
    corners = np.concatenate([segments.reshape(-1, 2), centres - radii, centres + radii])
    resolution = config.resolution_m
    low = np.floor((corners.min(axis=0) - config.margin_m) / resolution) * resolution
    cols, rows = (int(v) for v in np.ceil((corners.max(axis=0) + config.margin_m - low) / resolution))
    if rows * cols > MAX_CELLS:
        raise ConfigError(
            f"truth.resolution_m: a map of {rows} x {cols} cells is too large; make the cells larger than {resolution:g} m"
        )
    geometry = GridGeometry(resolution, (float(low[0]), float(low[1])))
    occupied = np.zeros((rows, cols), bool)
    for points in chain(
        (_segment_points(segment, resolution) for segment in segments),
        (_circle_points(circle, resolution) for circle in circles),
    ):
        row, col = np.minimum(
            geometry.cells(points), (rows - 1, cols - 1)
        ).T  # without margin, walls lie on the edge
        occupied[row, col] = True
    start = geometry.cells(np.array([scene.world.robot.start[:2]]))[0]
    free = reachable(~occupied, int(start[0]), int(start[1]))
    values = np.full((rows, cols), np.nan, np.float32)
    values[free] = 0.0
    values[occupied] = 1.0
    return OccupancyGrid(values, geometry)


def reachable(free: NDArray[np.bool_], row: int, col: int) -> NDArray[np.bool_]:
    """Mask `(rows, cols)` of the free cells 4-connected to a start cell; empty if the start is outside or not free."""
    import cv2

    rows, cols = free.shape
    if not (0 <= row < rows and 0 <= col < cols and free[row, col]):
        return np.zeros_like(free)
    mask = np.ones((rows + 2, cols + 2), np.uint8)  # the cells not to enter, with a border
    mask[1:-1, 1:-1] = ~free
    cv2.floodFill(
        np.zeros((rows, cols), np.uint8), mask, (col, row), 0, flags=4 | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    )
    return np.asarray(mask[1:-1, 1:-1] == 2)


def _segment_points(segment: Array, resolution: float) -> Array:
    count = int(np.hypot(*(segment[2:] - segment[:2])) / resolution * SAMPLES_PER_CELL) + 2
    return np.linspace(segment[:2], segment[2:], count)


def _circle_points(circle: Array, resolution: float) -> Array:
    count = int(2.0 * np.pi * circle[2] / resolution * SAMPLES_PER_CELL) + 8
    angle = np.linspace(0.0, 2.0 * np.pi, count)
    return np.asarray(circle[:2] + circle[2] * np.column_stack([np.cos(angle), np.sin(angle)]))
