"""Straight wall segments under points: moments by cell, and the lines fitted to windows of cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.infrared.wall_lines import (
    COUNT,
    MOMENTS,
    WX,
    WXX,
    WXY,
    WY,
    WYY,
    MapPoints,
    PoseEquations,
    W,
    WallCriteria,
    equations_on_lines,
    pooled_sums,
)
from gridslam.maps.growing_grid import GrowingGrid

Floats = NDArray[np.float64]

MIN_POINTS = 3.0  # two points lie on a line in any case; the third shows its thickness
ROBUST_SIGMAS = 2.5  # 99 % of Gaussian residuals are smaller
WALL_STD_M = 0.003  # standard deviation of a wall about its line
MIN_ASPECT_RATIO = 2.0  # smallest ratio of a wall segment's length to its thickness


@dataclass(frozen=True, slots=True)
class Lines:
    """n lines fitted to weighted points; NaN for a line without points.

    Centres of gravity (m) and unit normals `(n, 2)`; standard deviations of the points across and along the line (m) and numbers
    of points `(n,)`.
    """

    centres: Floats
    normals: Floats
    across_m: Floats
    along_m: Floats
    count: Floats

    def offsets(self, points: Floats) -> Floats:
        """Signed distances `(n,)` of points `(n, 2)` from their lines."""
        return np.asarray(np.sum((points - self.centres) * self.normals, axis=1))

    def are_walls(self, min_points: float, max_thickness_m: float) -> NDArray[np.bool_]:
        """Mask `(n,)` of the lines that are wall segments: enough points, thin, and at least twice as long as thick."""
        with np.errstate(invalid="ignore"):
            straight = (self.across_m < max_thickness_m) & (self.along_m > MIN_ASPECT_RATIO * self.across_m)
        return np.asarray((self.count >= min_points) & straight)


def lines_of_moments(moments: Floats) -> Lines:
    """Lines by total least squares from moments `(n, 7)`, whose columns `kernels/infrared/wall_lines.py` names."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = moments[:, WX] / moments[:, W], moments[:, WY] / moments[:, W]
        xx = moments[:, WXX] / moments[:, W] - x * x
        xy = moments[:, WXY] / moments[:, W] - x * y
        yy = moments[:, WYY] / moments[:, W] - y * y
    half, root = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)  # of the direction along the line
    normals = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    across = np.sqrt(np.maximum(half - root, 0.0))
    along = np.sqrt(np.maximum(half + root, 0.0))
    return Lines(np.stack([x, y], axis=1), normals, across, along, moments[:, COUNT])


def moments_of(points: Floats, weights: Floats) -> Floats:
    """The moments `(n, 7)` of single points `(n, 2)` with weights `(n,)`."""
    x, y = points[:, 0], points[:, 1]
    return np.stack(
        [
            np.ones(len(x)),
            weights,
            weights * x,
            weights * y,
            weights * x * x,
            weights * x * y,
            weights * y * y,
        ],
        axis=1,
    )


class WallMoments:
    """The moments of all points added so far, by cell of `cell_m` (m); `memory_limit_mb` limits the grid."""

    def __init__(self, cell_m: float, memory_limit_mb: float) -> None:
        self._grid = GrowingGrid(cell_m, memory_limit_mb, (MOMENTS,))

    def add(self, points: Floats, weights: Floats) -> None:
        """Add points `(n, 2)` with weights `(n,)`."""
        self._grid.cover(points)
        cells = self._grid.cells(points)
        np.add.at(self._grid.values, (cells[:, 0], cells[:, 1]), moments_of(points, weights))

    def lines(self, points: Floats, radius_cells: int) -> Lines:
        """For each of the `points` `(n, 2)`, the line through all added points within `radius_cells` cells of its cell."""
        return lines_of_moments(pooled_sums(self._grid.values, self._grid.cells(points), radius_cells))

    def equations(self, position: Floats, beams: MapPoints, max_thickness_m: float) -> PoseEquations:
        """Normal equations of the pose of a robot at `position` `(2,)` whose `beams` end on the walls."""
        hessian, gradient, on_walls = equations_on_lines(
            self._grid.values,
            self._grid.cells(position + beams.arms),
            beams,
            position,
            WallCriteria(MIN_POINTS, max_thickness_m, WALL_STD_M**2, ROBUST_SIGMAS),
        )
        return PoseEquations(hessian, gradient, int(on_walls))
