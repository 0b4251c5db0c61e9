"""Occupancy probabilities on a regular grid, and the geometry of grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
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


def nth_cells(marked: NDArray[np.bool_], numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cells `(n, 2)` that `argwhere` would have at these places `(n,)`; a list of all would take more memory than the map."""
    ends = np.cumsum(np.count_nonzero(marked, axis=1))
    rows = np.searchsorted(ends, numbers, side="right")
    cols = np.empty(len(numbers), np.int64)
    order = np.argsort(rows, kind="stable")
    for chosen in np.split(order, np.flatnonzero(np.diff(rows[order])) + 1):
        if len(chosen):
            row = rows[chosen[0]]
            cols[chosen] = np.flatnonzero(marked[row])[numbers[chosen] - (ends[row - 1] if row else 0)]
    return np.column_stack([rows, cols])


def refuse_noise(shape: tuple[int, ...], count: int, what: str) -> None:
    """Raise MapError where a map `(rows, cols)` has at least `count` such cells, which are more than MAX_MARKED_CELLS."""
    if count > MAX_MARKED_CELLS:
        raise MapError(
            f"a map of {shape[1]} x {shape[0]} cells has at least {count} {what} cells; the limit is {MAX_MARKED_CELLS}: "
            "cut a part out of it with `gridslam maps crop`"
        )


def values_under(
    grid: OccupancyGrid, T_grid_other: NDArray[np.float64], other: GridGeometry, part: tuple[slice, slice]
) -> NDArray[np.float32]:
    """Probabilities of the map's cells under the centres of some rows and columns of another grid; NaN outside the map.

    T_grid_other `(3,)` is the other map's frame in that of `grid`, and `part` the rows and columns, the shape of the result.
        Where the axes of both are parallel, rows and columns are looked up apart, which takes a tenth of the time.
    """
    rows, cols = (np.arange(s.start, s.stop) for s in part)
    shape = grid.probability.shape
    values = np.full((len(rows), len(cols)), np.nan, np.float32)
    if not values.size:
        return values
    if T_grid_other[2] or grid.geometry.yaw_rad or other.yaw_rad:
        at = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2)
        cells = grid.geometry.cells(se2.transform_points(T_grid_other, other.centres(at)))
        inside = ((cells >= 0) & (cells < shape)).all(axis=1)
        values.ravel()[inside] = grid.probability[cells[inside, 0], cells[inside, 1]]
        return values
    in_column = np.stack([rows, np.full_like(rows, cols[0])], axis=1)
    in_row = np.stack([np.full_like(cols, rows[0]), cols], axis=1)
    row, col = (
        grid.geometry.cells(se2.transform_points(T_grid_other, other.centres(cells)))[:, axis]
        for axis, cells in enumerate((in_column, in_row))
    )
    has_row, has_col = (row >= 0) & (row < shape[0]), (col >= 0) & (col < shape[1])
    values[np.ix_(has_row, has_col)] = grid.probability[np.ix_(row[has_row], col[has_col])]
    return values
