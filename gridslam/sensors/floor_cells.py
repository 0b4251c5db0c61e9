"""Square cells of the floor, by their indices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.grids.raycast import cast_rays, free_squares
from gridslam.maps.occupancy import OccupancyGrid

Floats = NDArray[np.float64]

_AT_WALL_M = 0.5  # a camera hangs at a wall, which does not hide the floor before it
CELLS_AT_ONCE = 1 << 18  # number of cells of a large map that are processed together


class Floor(Protocol):
    """Places where the robot may be, as floor cells."""

    def within(self, low: Floats, high: Floats) -> FloorCells:
        """The floor cells with centres in a box of the map frame from `low` `(2,)` to `high` `(2,)`, sorted by x, then y."""


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

    def within(self, low: Floats, high: Floats) -> FloorCells:
        """Those with centres in a box of the map frame from `low` `(2,)` to `high` `(2,)`."""
        centres = self.centres
        return self.select(np.asarray(((centres >= low) & (centres <= high)).all(axis=1)))

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


@dataclass(frozen=True, slots=True)
class FreeFloor:
    """The floor cells of size `size_m` that contain the centre of a free map cell: known, of at most `free_threshold`.

    None is kept, as those of a large map would take several times its memory.
    """

    occupancy: OccupancyGrid
    free_threshold: float
    size_m: float

    def within(self, low: Floats, high: Floats) -> FloorCells:
        """Floor cells with centres in a box of the map frame, as `Floor.within`."""
        geometry, probability = self.occupancy.geometry, self.occupancy.probability
        shape = np.array(probability.shape)
        extent = geometry.centres(np.array([[r, c] for r in (-1, shape[0]) for c in (-1, shape[1])]))
        low_xy, high_xy = np.clip(
            [low - self.size_m, high + self.size_m], extent.min(axis=0), extent.max(axis=0)
        )
        corners = geometry.cells(
            np.array([[x, y] for x in (low_xy[0], high_xy[0]) for y in (low_xy[1], high_xy[1])])
        )
        (row0, col0), (row1, col1) = np.clip(
            [corners.min(axis=0), corners.max(axis=0) + 1], 0, shape
        ).tolist()
        step = max(CELLS_AT_ONCE // max(col1 - col0, 1), 1)
        parts = []
        for row in range(row0, row1, step):
            free = np.argwhere(probability[row : min(row + step, row1), col0:col1] <= self.free_threshold)
            points = geometry.centres(free + np.array([row, col0]))
            parts.append(FloorCells.containing(points, self.size_m).unique().within(low, high))
        return FloorCells.joined(parts, self.size_m).unique()
