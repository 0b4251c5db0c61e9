"""The likelihood field model: a beam is as likely as its end point is near a wall (Thrun et al. 2005, sec. 6.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.likelihood_field import sum_over_points
from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.grid_frame import poses_in_cells

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

FAR = 255  # the byte of everything at or beyond the field's reach, and outside the grid


@dataclass(frozen=True, slots=True)
class DistanceField:
    """Distance to the nearest occupied cell, uint8 `(rows, cols)` in steps of reach / 255; 255 is the reach or more."""

    steps: NDArray[np.uint8]
    geometry: GridGeometry
    reach_m: float

    @property
    def distances_m(self) -> Floats:
        """The distance that each of the 256 values stands for."""
        return np.arange(256, dtype=np.float64) * (self.reach_m / FAR)

    def sums(self, table: Table, points: Floats, poses: Floats) -> Floats:
        """Sum of the table's values `(n,)` over the points `(m, 2)` of the robot's frame, seen from poses `(n, 3)`."""
        in_cells = (points / self.geometry.resolution_m).astype(np.float32)
        return np.asarray(sum_over_points(self.steps, table, in_cells, poses_in_cells(self.geometry, poses)))

    def near(self, places: Floats, radius_m: float, step: int) -> DistanceField:
        """The field with values of at most `step` within the radius of places `(k, 2)`, where something else than walls is."""
        reach = int(np.ceil(radius_m / self.geometry.resolution_m))
        disc = np.argwhere(np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) <= reach) - reach
        cells = (self.geometry.cells(places)[:, None] + disc).reshape(-1, 2)
        rows, cols = cells[(cells >= 0).all(axis=1) & (cells < self.steps.shape).all(axis=1)].T
        steps = self.steps.copy()
        steps[rows, cols] = np.minimum(steps[rows, cols], step)
        return DistanceField(steps, self.geometry, self.reach_m)

    def under(self, points: Floats, pose: Floats) -> Floats:
        """Distance to the nearest wall `(m,)` of each point `(m, 2)` seen from one pose; capped at the reach."""
        cells = self.geometry.cells(se2.transform_points(pose, points))
        rows, cols = self.steps.shape
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        steps = np.full(len(points), FAR, np.uint8)
        steps[inside] = self.steps[cells[inside, 0], cells[inside, 1]]
        return self.distances_m[steps]


def distance_field(occupied: NDArray[np.bool_], geometry: GridGeometry, reach_m: float) -> DistanceField:
    """The field of a grid of occupied cells `(rows, cols)`: exact Euclidean distances between cell centres."""
    walls = OccupancyGrid(occupied.astype(np.float32), geometry)
    distances = distance_to_occupied(walls, max_distance_m=reach_m).values.astype(np.float64)
    steps = np.rint(distances * (FAR / reach_m)).astype(np.uint8)
    return DistanceField(steps, geometry, reach_m)


def occupied_cells(occupancy: OccupancyGrid, threshold: float) -> NDArray[np.bool_]:
    """Cells known to be occupied with at least this probability."""
    return np.nan_to_num(occupancy.probability, nan=0.0) >= threshold


def log_likelihood_table(field: DistanceField, sigma_m: float, random_share: float) -> Table:
    """Log-likelihood of a beam by the field's value: Gaussian about walls, and a share that anything may have caused.

    Scaled so that a beam that ends on a wall has log-likelihood 0; the worst is log(random_share).
    """
    near = np.exp(-0.5 * (field.distances_m / sigma_m) ** 2)
    near[FAR] = 0.0
    return np.log((1.0 - random_share) * near + random_share).astype(np.float32)
