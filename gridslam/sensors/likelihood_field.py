"""The likelihood field model: likelihood of a beam by its endpoint's distance to walls (Thrun et al. 2005, sec. 6.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.localization.likelihood_field import sum_over_points
from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.grid_frame import poses_in_cells

Floats = NDArray[np.float64]
Table = NDArray[np.float32]

CELLS_AT_ONCE = 1 << 22  # number of cells of a large map that are processed together
FAR = 255  # the byte of every distance at or beyond the field's maximum, and of everything outside the grid


@dataclass(frozen=True, slots=True)
class DistanceField:
    """Distances to the nearest occupied cell, uint8 `(rows, cols)` in steps of max_distance_m / 255; 255: the maximum or more."""

    steps: NDArray[np.uint8]
    geometry: GridGeometry
    max_distance_m: float

    @property
    def distances_m(self) -> Floats:
        """The distances `(256,)` (m) that the byte values stand for."""
        return np.arange(256, dtype=np.float64) * (self.max_distance_m / FAR)

    def table_sums(self, table: Table, points: Floats, poses: Floats) -> Floats:
        """Sums `(n,)` of the table's values under the points `(m, 2)`, given in the robot's frame, for robot poses `(n, 3)`."""
        in_cells = (points / self.geometry.resolution_m).astype(np.float32)
        return np.asarray(sum_over_points(self.steps, table, in_cells, poses_in_cells(self.geometry, poses)))

    def with_objects(self, centres: Floats, radius_m: float, step: int) -> DistanceField:
        """A copy with values of at most `step` within the radius of the centres `(k, 2)`, where moving objects are."""
        radius = int(np.ceil(radius_m / self.geometry.resolution_m))
        disc = np.argwhere(np.hypot(*np.mgrid[-radius : radius + 1, -radius : radius + 1]) <= radius) - radius
        cells = (self.geometry.cells(centres)[:, None] + disc).reshape(-1, 2)
        rows, cols = cells[(cells >= 0).all(axis=1) & (cells < self.steps.shape).all(axis=1)].T
        steps = self.steps.copy()
        steps[rows, cols] = np.minimum(steps[rows, cols], step)
        return DistanceField(steps, self.geometry, self.max_distance_m)

    def distances_at(self, points: Floats, pose: Floats) -> Floats:
        """Distances `(m,)` to the nearest wall of points `(m, 2)` in the frame of a robot pose; at most the field's maximum."""
        cells = self.geometry.cells(se2.transform_points(pose, points))
        rows, cols = self.steps.shape
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        steps = np.full(len(points), FAR, np.uint8)
        steps[inside] = self.steps[cells[inside, 0], cells[inside, 1]]
        return self.distances_m[steps]


def distance_field(
    occupied: NDArray[np.bool_], geometry: GridGeometry, max_distance_m: float
) -> DistanceField:
    """The distance field of a grid of occupied cells `(rows, cols)`: exact Euclidean distances between cell centres.

    Of a large map band by band, each with the walls around it that are near enough to matter.
    """
    steps = np.empty(occupied.shape, np.uint8)
    rows, cols = occupied.shape
    margin = math.ceil(min(max_distance_m / geometry.resolution_m, rows)) + 1
    band = max(CELLS_AT_ONCE // max(cols, 1), 2 * margin)
    for first in range(0, rows, band):
        before = min(first, margin)
        in_cells = distances_to(occupied[first - before : first + band + margin])[before:][:band]
        distance_m = np.minimum(in_cells * np.float32(geometry.resolution_m), np.float32(max_distance_m))
        steps[first : first + band] = np.rint(distance_m.astype(np.float64) * (FAR / max_distance_m))
    return DistanceField(steps, geometry, max_distance_m)


def occupied_cells(occupancy: OccupancyGrid, threshold: float) -> NDArray[np.bool_]:
    """Mask `(rows, cols)` of the known cells with at least this probability of occupancy."""
    return np.asarray(occupancy.probability >= threshold)  # not true of NaN


def log_likelihood_table(field: DistanceField, sigma_m: float, random_weight: float) -> Table:
    """Log-likelihoods `(256,)` of a beam by the field's byte under its endpoint: a Gaussian about walls and a uniform part.

    The uniform part, of weight `random_weight`, accounts for people and changes. Values are scaled so that an endpoint on a wall
    has log-likelihood 0; the smallest value is log(random_weight).
    """
    near = np.exp(-0.5 * (field.distances_m / sigma_m) ** 2)
    near[FAR] = 0.0
    return np.log((1.0 - random_weight) * near + random_weight).astype(np.float32)
