"""Occupancy probabilities on a regular grid, and the geometry of grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MapError

# Looked at one by one; the walls of 400 m x 400 m of offices at 5 cm are a tenth of that.
MAX_MARKED_CELLS = 4_000_000


@dataclass(frozen=True, slots=True)
class GridGeometry:
    """Cell size and pose of a grid: `origin_xy_m` is the lower-left corner of cell (0, 0), `yaw_rad` the rotation about it."""

    resolution_m: float
    origin_xy_m: tuple[float, float]
    yaw_rad: float = 0.0

    def cells(self, points_xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Cells (row, col) `(n, 2)` of points (x, y) `(n, 2)` in the map frame; cells may lie outside the grid."""
        local = points_xy - np.asarray(self.origin_xy_m)
        if self.yaw_rad:
            cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
            local = local @ np.array([[cos, -sin], [sin, cos]])
        return np.asarray(np.floor(local[..., ::-1] / self.resolution_m), dtype=np.int64)

    def centres(self, cells: NDArray[np.int64] | NDArray[np.float64]) -> NDArray[np.float64]:
        """Centres (x, y) `(n, 2)` in the map frame of cells (row, col) `(n, 2)`, which may be fractional: -0.5 gives a corner."""
        local = (np.asarray(cells, dtype=np.float64)[..., ::-1] + 0.5) * self.resolution_m
        if self.yaw_rad:
            cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
            local = local @ np.array([[cos, sin], [-sin, cos]])
        return np.asarray(local + np.asarray(self.origin_xy_m))


@dataclass(frozen=True, slots=True)
class GridLayer:
    """Values `(rows, cols)` of any kind on a grid."""

    values: NDArray[np.generic]
    geometry: GridGeometry


@dataclass(frozen=True, slots=True)
class OccupancyGrid:
    """Occupancy probabilities, float32 `(rows, cols)`; NaN in unknown cells."""

    probability: NDArray[np.float32]
    geometry: GridGeometry


def marked_cells(mask: NDArray[np.bool_], what: str = "wall") -> NDArray[np.int64]:
    """Cells (row, col) `(n, 2)` that a mask `(rows, cols)` marks. Raises MapError: more than MAX_MARKED_CELLS, as in noise."""
    refuse_noise(mask.shape, int(np.count_nonzero(mask)), what)
    return np.argwhere(mask)


def refuse_noise(shape: tuple[int, ...], count: int, what: str) -> None:
    """Raise MapError where a map `(rows, cols)` has at least `count` such cells, which are more than MAX_MARKED_CELLS."""
    if count > MAX_MARKED_CELLS:
        raise MapError(
            f"a map of {shape[1]} x {shape[0]} cells has at least {count} {what} cells; the limit is {MAX_MARKED_CELLS}: "
            "cut a part out of it with `gridslam maps crop`"
        )
