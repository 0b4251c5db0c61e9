"""Picture of the map with the coverage and the detections of the fixed cameras, and the estimated path."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.picture.cells import Opacity, Tint
from gridslam.maps.preview import PathMarks, render_map
from gridslam.methods.base import Picture
from gridslam.sensors.floor_cells import CELLS_AT_ONCE, FloorCells

COVERED, MOVING = (120, 170, 235), (235, 120, 30)
COVERED_OPACITY = 0.45
MIN_MOVING_OPACITY = 0.35  # opacity of a place with one detection; the place with most is opaque
NOTE = "Blue: floor in view of a fixed camera. Orange: moving objects, the robot and people alike; darker where there were more."


def coverage_picture(
    occupancy: OccupancyGrid,
    coverage: FloorCells,
    moving: FloorCells,
    path: Trajectory,
    is_untrusted: NDArray[np.bool_],
) -> Picture:
    """The map with the covered floor cells in blue, the detections in orange by their number, and the path.

    `is_untrusted` `(n,)`: the robot was not localized at these poses of the path.
    """
    covered, moved = FloorCounts.of(occupancy, coverage), FloorCounts.of(occupancy, moving)
    max_count = max((int(part.max()) for part in moved.in_bands()), default=0)

    def covered_opacity(rows: slice, cols: slice) -> Opacity:
        return np.where(covered.part(rows, cols) > 0, np.float32(COVERED_OPACITY), np.float32(0.0))

    def moved_opacity(rows: slice, cols: slice) -> Opacity:
        counts = moved.part(rows, cols)
        opacity = MIN_MOVING_OPACITY + (1.0 - MIN_MOVING_OPACITY) * np.sqrt(counts / max(max_count, 1))
        return np.where(counts > 0, opacity, 0.0).astype(np.float32)

    tints = (Tint(covered_opacity, COVERED, "in view"), Tint(moved_opacity, MOVING, "moving"))
    sheet = render_map(occupancy, path, tints=tints, marks=PathMarks(is_untrusted))
    return Picture(np.asarray(sheet, np.uint8), "Fixed cameras: coverage and detections", NOTE)


@dataclass(frozen=True, slots=True)
class FloorCounts:
    """Numbers of floor cells on each cell of a map.

    Floor cells lie about the map cells `centres` `(k, 2)`, `repeats` `(k,)` of them at each. They are counted part by part:
    those of a large map take four times its memory.
    """

    centres: NDArray[np.int64]
    repeats: NDArray[np.int64]
    shape: tuple[int, int]
    half_width: int  # of a floor cell, in map cells

    @staticmethod
    def of(occupancy: OccupancyGrid, cells: FloorCells) -> FloorCounts:
        """The counts on a map; floor cells that are repeated count repeatedly."""
        index, repeats = np.unique(cells.index, axis=0, return_counts=True)
        centres = occupancy.geometry.cells(FloorCells(index, cells.size_m).centres)
        rows, cols = occupancy.probability.shape
        half_width = int(cells.size_m / occupancy.geometry.resolution_m / 2.0)
        return FloorCounts(centres, repeats, (rows, cols), half_width)

    def part(self, rows: slice, cols: slice) -> NDArray[np.int64]:
        """The counts `(r, c)` of some rows and columns."""
        margin, width = self.half_width, 2 * self.half_width + 1
        first = np.array([rows.start, cols.start]) - margin
        size = np.array([rows.stop - rows.start, cols.stop - cols.start]) + 2 * margin
        at = self.centres - first
        inside = ((at >= 0) & (at < size)).all(axis=1)
        counts = np.zeros(size + 1, np.int64)
        np.add.at(counts, tuple(at[inside].T + 1), self.repeats[inside])
        for axis in range(2):
            np.cumsum(counts, axis=axis, out=counts)
        return (
            counts[width:, width:]
            - counts[width:, :-width]
            - counts[:-width, width:]
            + counts[:-width, :-width]
        )

    def in_bands(self) -> Iterator[NDArray[np.int64]]:
        """The counts `(r, cols)` of the whole map, some rows at once."""
        rows, cols = self.shape
        at_once = max(CELLS_AT_ONCE // max(cols, 1), 1)
        for first in range(0, rows, at_once):
            yield self.part(slice(first, min(first + at_once, rows)), slice(0, cols))
