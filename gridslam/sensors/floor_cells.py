"""Square cells of the floor, by their indices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.raycast import cast_rays, free_squares

Floats = NDArray[np.float64]

_AT_WALL_M = 0.5  # a camera hangs at a wall, which does not hide the floor before it


@dataclass(frozen=True, slots=True)
class FloorCells:
    """Cells of size `size_m` with the indices (x, y) `(k, 2)`; cell (0, 0) has its lower-left corner at the map's origin."""

    index: NDArray[np.int64]
    size_m: float

    def __len__(self) -> int:
        return len(self.index)

    @staticmethod
    def containing(points: Floats, size_m: float) -> FloorCells:
        """The cell of each of the points `(k, 2)` in the map frame (m)."""
        return FloorCells(np.floor(points / size_m).astype(np.int64), size_m)

    @staticmethod
    def joined(cells: Sequence[FloorCells], size_m: float) -> FloorCells:
        """All of the cells, in their order."""
        return FloorCells(np.concatenate([*(c.index for c in cells), np.zeros((0, 2), np.int64)]), size_m)

    @property
    def centres(self) -> Floats:
        """Their centres `(k, 2)` in the map frame (m)."""
        return np.asarray((self.index + 0.5) * self.size_m)

    def select(self, mask: NDArray[np.bool_] | NDArray[np.int64]) -> FloorCells:
        """Those for which the mask `(k,)` is True, or those at these indices."""
        return FloorCells(self.index[mask], self.size_m)

    def unique(self) -> FloorCells:
        """Each of them once, sorted by x, then y."""
        ordered = self.index[np.lexsort(self.index.T[::-1])]
        is_new = np.ones(len(ordered), np.bool_)
        is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
        return FloorCells(ordered[is_new], self.size_m)


def visible_from(floor: FloorCells, cells: FloorCells, place: Floats) -> NDArray[np.bool_]:
    """Mask `(k,)` of the cells from which a line to a place `(2,)` leads over the floor, all but its last half metre."""
    corner = floor.index.min(axis=0, initial=0)
    cols, rows = (floor.index.max(axis=0, initial=0) + 1 - corner).tolist()
    walls = np.ones((rows, cols), np.bool_)
    walls[floor.index[:, 1] - corner[1], floor.index[:, 0] - corner[0]] = False
    start = cells.index - corner + 0.5
    off = place / floor.size_m - corner - start
    poses = np.column_stack([start, np.arctan2(off[:, 1], off[:, 0])])
    distance = np.hypot(*off.T)
    free = cast_rays(free_squares(walls), poses, np.zeros(1), float(distance.max(initial=1.0)))[:, 0]
    return np.asarray(free >= distance - _AT_WALL_M / floor.size_m)
