"""The straight pieces of wall that points lie on: sums over cells, and lines fitted to what a window of cells holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.wall_lines import equations_on_lines, pooled_sums
from gridslam.maps.growing_grid import GrowingGrid

Floats = NDArray[np.float64]

_CHANNELS = 7  # count, w, wx, wy, wxx, wxy, wyy
_LEAST_POINTS = 3.0
_ROBUST_SIGMAS = 2.5
_MAP_M = 0.003  # deviation of the map's own lines


@dataclass(frozen=True, slots=True)
class Lines:
    """Weighted lines, one for each of n places: centre of gravity and unit normal `(n, 2)`, deviation across and along the line,
    and number of points `(n,)`; NaN where there are none.
    """

    centres: Floats
    normals: Floats
    across_m: Floats
    along_m: Floats
    count: Floats

    def offsets(self, points: Floats) -> Floats:
        """Signed distances `(n,)` of points `(n, 2)` from their lines."""
        return np.asarray(np.sum((points - self.centres) * self.normals, axis=1))

    def are_walls(self, least_points: float, thickest_m: float) -> NDArray[np.bool_]:
        """Which of them have enough points in a row: thinner than `thickest_m` and at least twice as long as thick."""
        with np.errstate(invalid="ignore"):
            straight = (self.across_m < thickest_m) & (self.along_m > 2.0 * self.across_m)
        return np.asarray((self.count >= least_points) & straight)


def lines_of_sums(sums: Floats) -> Lines:
    """Lines by total least squares from sums `(n, 7)`: count, w, wx, wy, wxx, wxy, wyy."""
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = sums[:, 2] / sums[:, 1], sums[:, 3] / sums[:, 1]
        xx = sums[:, 4] / sums[:, 1] - x * x
        xy = sums[:, 5] / sums[:, 1] - x * y
        yy = sums[:, 6] / sums[:, 1] - y * y
    half, root = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)  # of the direction along the line
    normals = np.stack([-np.sin(angle), np.cos(angle)], axis=1)
    across = np.sqrt(np.maximum(half - root, 0.0))
    along = np.sqrt(np.maximum(half + root, 0.0))
    return Lines(np.stack([x, y], axis=1), normals, across, along, sums[:, 0])


def moments(points: Floats, weights: Floats) -> Floats:
    """The sums of single points, `(n, 7)`."""
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


class WallSums:
    """Sums of all points so far, by cell."""

    def __init__(self, cell_m: float, memory_limit_mb: float) -> None:
        self._grid = GrowingGrid(cell_m, memory_limit_mb, (_CHANNELS,))

    def add(self, points: Floats, weights: Floats) -> None:
        """Take in points `(n, 2)` with weights `(n,)`."""
        self._grid.cover(points)
        cells = self._grid.cells(points)
        np.add.at(self._grid.values, (cells[:, 0], cells[:, 1]), moments(points, weights))

    def lines(self, points: Floats, reach_cells: int) -> Lines:
        """The line through what lies within so many cells about the cell of each point `(n, 2)`."""
        return lines_of_sums(pooled_sums(self._grid.values, self._grid.cells(points), reach_cells))

    def equations(
        self, position: Floats, arms: Floats, directions: Floats, variances: Floats, thickest_m: float
    ) -> tuple[Floats, Floats, int]:
        """Normal equations of points on the lines about them, by the pose of the robot at `position` `(2,)`: hessian `(3, 3)`,
        gradient `(3,)`, and how many points are on a wall.

        `arms` and the beams' unit `directions` `(n, 2)` are in the axes of the map, `variances` `(n, 2)` along and across the
        beams.
        """
        hessian, gradient, on_walls = equations_on_lines(
            self._grid.values,
            self._grid.cells(position + arms),
            _LEAST_POINTS,
            thickest_m,
            arms,
            directions,
            variances,
            _MAP_M**2,
            _ROBUST_SIGMAS,
            position,
        )
        return hessian, gradient, int(on_walls)
