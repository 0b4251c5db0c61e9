"""A dense grid that grows to cover the points written into it, up to a memory limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.maps.occupancy import GridGeometry

Floats = NDArray[np.float64]

_MARGIN_CELLS = 64


class GrowingGrid:
    """Values float64 `(rows, cols, ...)`, initially zero, on a grid that grows to cover the points added.

    The lattice is the infinite grid of which `values` is a part; the lower left corner of its cell (0, 0) is at x = y = 0 in the
    map frame. `channels` is the shape of the value of one cell.

    Raises MethodError: the grid would need more than `memory_limit_mb`, as after a wrong pose, or a point is not finite.
    """

    def __init__(self, resolution_m: float, memory_limit_mb: float, channels: tuple[int, ...] = ()) -> None:
        self.resolution_m = resolution_m
        self._limit_mb = memory_limit_mb
        self.values: Floats = np.zeros((0, 0, *channels))
        self.corner = np.zeros(2, np.int64)  # lattice cell (row, col) of values[0, 0]

    @property
    def geometry(self) -> GridGeometry:
        """The geometry of `values`."""
        row, col = self.corner.tolist()
        return GridGeometry(self.resolution_m, (col * self.resolution_m, row * self.resolution_m))

    def cells(self, points: Floats) -> NDArray[np.int64]:
        """Indices (row, col) `(n, 2)` in `values` of points `(n, 2)`; they may lie outside."""
        return self.lattice(points) - self.corner

    def lattice(self, points: Floats) -> NDArray[np.int64]:
        """Lattice cells (row, col) `(n, 2)` of points `(n, 2)`."""
        return np.asarray(np.floor(points[:, ::-1] / self.resolution_m), dtype=np.int64)

    def cover(self, points: Floats, margin_cells: int = 0) -> None:
        """Grow the grid to cover all points `(n, 2)` and a margin around them."""
        if not len(points):
            return
        corners = np.array([points.min(axis=0), points.max(axis=0)])  # NaN if a point is NaN
        if not np.isfinite(corners).all():
            raise MethodError("a pose or a reading is not finite: the map cannot take it in")
        self._check((corners[1] - corners[0]) / self.resolution_m)
        cells = self.lattice(corners)
        low, high = cells[0] - margin_cells, cells[1] + margin_cells + 1
        size = np.array(self.values.shape[:2])
        if size.all():
            if (low >= self.corner).all() and (high <= self.corner + size).all():
                return
            low, high = np.minimum(low, self.corner), np.maximum(high, self.corner + size)
        low, high = low - _MARGIN_CELLS, high + _MARGIN_CELLS
        self._check((high - low).astype(np.float64))
        grown = np.zeros((*(high - low), *self.values.shape[2:]))
        row, col = self.corner - low
        grown[row : row + size[0], col : col + size[1]] = self.values
        self.values, self.corner = grown, low

    def _check(self, size: Floats) -> None:
        needed_mb = 8e-6 * float(np.prod(size + 1.0)) * float(np.prod(self.values.shape[2:]))
        if not needed_mb <= self._limit_mb:
            raise MethodError(
                f"the map would need {needed_mb:.0f} MB, more than memory_limit_mb = {self._limit_mb:g}: "
                "either the trajectory is wrong, or raise the limit or coarsen method.resolution_m"
            )
