"""Likelihood of a scan in the drawing: endpoints near drawn walls, with the tolerance that drawings need (paper section 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.drawings.drawn_field import sum_over_stretched_points
from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

OUTLIER_FRACTION = 0.15  # fraction of points on objects that the drawing lacks: furniture, people, open doors
TABLE_ENTRIES = 256
MAX_DISTANCE_SIGMAS = 4.0  # points farther from drawn walls all count as outliers
INLIER_SIGMAS = 2.0  # points closer than this to a drawn wall are inliers


class DrawnLikelihood:
    """The likelihood field of a drawing at any scale, over distances in metres of the world.

    In metres, a small copy of the scan beside a wall scores no higher than a large one.
    """

    def __init__(self, drawn: DrawnMap, sigma_m: float) -> None:
        self._geometry = drawn.geometry
        walls = OccupancyGrid(drawn.walls.astype(np.float32), drawn.geometry)
        self._field = np.asarray(distance_to_occupied(walls).values, dtype=np.float32)
        self._entries_per_m = (TABLE_ENTRIES - 1) / (MAX_DISTANCE_SIGMAS * sigma_m)
        distances = np.arange(TABLE_ENTRIES) / self._entries_per_m
        near = np.exp(-0.5 * (distances / sigma_m) ** 2)
        near[-1] = 0.0
        self._log = np.log((1.0 - OUTLIER_FRACTION) * near + OUTLIER_FRACTION).astype(np.float32)
        self._free = drawn.free
        self._is_inlier = (distances < INLIER_SIGMAS * sigma_m).astype(np.float32)

    def log_likelihood(self, points: Floats, states: Floats) -> Floats:
        """Log-likelihoods `(n,)` of points `(m, 2)` (robot's frame, m) for states `(n, 5)`: x, y, yaw, log scales."""
        return self._sums(self._log, points, states)

    def is_free(self, states: Floats) -> NDArray[np.bool_]:
        """Whether the robot of each state `(n, 5)` stands in the drawing's free space, `(n,)`."""
        cells = self._geometry.cells(states[:, :2])
        rows, cols = self._free.shape
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        return np.asarray(
            inside & self._free[np.clip(cells[:, 0], 0, rows - 1), np.clip(cells[:, 1], 0, cols - 1)]
        )

    def inlier_ratio(self, points: Floats, state: Floats) -> float:
        """Fraction of the points close to drawn walls, for one state `(5,)`; 0 if there are no points."""
        if not len(points):
            return 0.0
        return float(self._sums(self._is_inlier, points, state[None])[0]) / len(points)

    def _sums(self, table: Table, points: Floats, states: Floats) -> Floats:
        return np.asarray(
            sum_over_stretched_points(
                field=self._field,
                resolution_m=self._geometry.resolution_m,
                table=table,
                entries_per_m=self._entries_per_m,
                points=np.ascontiguousarray(points),
                states=np.ascontiguousarray(states),
            )
        )
