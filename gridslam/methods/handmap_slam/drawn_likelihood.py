"""How well a scan fits a drawing: end points near drawn walls, with the tolerance that drawings need (paper section 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.drawn_field import sum_over_stretched_points
from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.drawing import DrawnMap
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

ENTRIES = 256
REACH_SIGMAS = 4.0
NEAR_SIGMAS = 2.0  # a point so near is explained by the drawing


class DrawnLikelihood:
    """The likelihood field of a drawing for any scale; distances count in metres of the world.

    So a small copy of the scan beside a wall fits no better than a large one.
    """

    def __init__(self, drawn: DrawnMap, sigma_m: float, random_share: float) -> None:
        self._geometry = drawn.geometry
        walls = OccupancyGrid(drawn.walls.astype(np.float32), drawn.geometry)
        self._field = np.asarray(distance_to_occupied(walls).values, dtype=np.float32)
        self._per_m = (ENTRIES - 1) / (REACH_SIGMAS * sigma_m)
        distances = np.arange(ENTRIES) / self._per_m
        near = np.exp(-0.5 * (distances / sigma_m) ** 2)
        near[-1] = 0.0
        self._log = np.log((1.0 - random_share) * near + random_share).astype(np.float32)
        self._free = drawn.free
        self._near = (distances < NEAR_SIGMAS * sigma_m).astype(np.float32)

    def log_likelihood(self, points: Floats, states: Floats) -> Floats:
        """Sum of log-likelihoods `(n,)` of points `(m, 2)` of the robot's frame for states `(n, 5)`: x, y, yaw, log scales."""
        return self._sums(self._log, points, states)

    def is_free(self, states: Floats) -> NDArray[np.bool_]:
        """Whether the drawing has free space `(n,)` where the robot of each state `(n, 5)` stands."""
        cells = self._geometry.cells(states[:, :2])
        rows, cols = self._free.shape
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        return np.asarray(
            inside & self._free[np.clip(cells[:, 0], 0, rows - 1), np.clip(cells[:, 1], 0, cols - 1)]
        )

    def share_near(self, points: Floats, state: Floats) -> float:
        """Share of the points that lie near drawn walls, for one state `(5,)`; 0 without points."""
        if not len(points):
            return 0.0
        return float(self._sums(self._near, points, state[None])[0]) / len(points)

    def _sums(self, table: Table, points: Floats, states: Floats) -> Floats:
        return np.asarray(
            sum_over_stretched_points(
                self._field,
                self._geometry.resolution_m,
                table,
                self._per_m,
                np.ascontiguousarray(points),
                np.ascontiguousarray(states),
            )
        )
