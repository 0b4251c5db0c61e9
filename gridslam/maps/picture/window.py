"""The part of a map that a picture shows, and its scale; long maps are divided into pieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

Floats = NDArray[np.float64]
Box = NDArray[np.int64]  # first row, one past the last row, first column, one past the last column

ENLARGE_TO_PX = 1200
SHRINK_TO_PX = 2000
MAX_CELL_PX = 24
MIN_SIDE_PX = 240
MARGIN_PX = 12
OUTLIER_RATIO = 0.001  # fraction of the known cells that may be left out at each side
# They are kept where they reach less than this, as a ratio of the others' extent, beyond the others
OUTLIER_EXTENT = 0.04
MIN_DIVIDED_RATIO = 3.5  # ratio of the sides of a map from which on it is divided
SHEET_RATIO = 1.3  # approximate ratio of the sides of the pieces together
MAX_PIECES = 12
MIN_PIECE_PX = 120
ROWS_AT_ONCE = 64  # rows of a large map that are examined together
AXIS_RATIO = 0.06  # height of a piece's axis, as a ratio of the piece's length


@dataclass(frozen=True, slots=True)
class MapWindow:
    """The cells [row0, row1) x [col0, col1) of a picture, and its pixels a cell."""

    geometry: GridGeometry
    row0: int
    row1: int
    col0: int
    col1: int
    zoom: float

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the picture."""
        return round((self.col1 - self.col0) * self.zoom), round((self.row1 - self.row0) * self.zoom)

    @property
    def px_per_m(self) -> float:
        """Scale of the picture."""
        return self.zoom / self.geometry.resolution_m

    def pixels(self, points_xy: Floats) -> Floats:
        """Pixel coordinates `(n, 2)`, x to the right and y down, of points `(n, 2)` of the map frame."""
        cells = grid_coordinates(self.geometry, points_xy)
        return np.stack(
            [(cells[:, 0] - self.col0) * self.zoom, (self.row1 - cells[:, 1]) * self.zoom], axis=1
        )

    def limits_m(self) -> tuple[Floats, Floats]:
        """First and last coordinate (m) of the window along the grid's x axis `(2,)`, and along its y axis `(2,)`.

        They count from the origin of the map frame; for a grid that is not turned they are x and y of the map.
        """
        step = self.geometry.resolution_m
        offset = -grid_coordinates(self.geometry, np.zeros((1, 2)))[0] * step
        cols, rows = np.array([self.col0, self.col1]), np.array([self.row0, self.row1])
        return offset[0] + cols * step, offset[1] + rows * step


def grid_coordinates(geometry: GridGeometry, points_xy: Floats) -> Floats:
    """Points `(n, 2)` in cells along the grid's axes: (column, row), not rounded."""
    cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
    local = (points_xy - np.asarray(geometry.origin_xy_m)) @ np.array([[cos, -sin], [sin, cos]])
    return np.asarray(local / geometry.resolution_m)


def choose_windows(grid: OccupancyGrid, path_xy: Floats, whole: bool = False) -> list[MapWindow]:
    """The windows of a picture of the known cells, or all cells if `whole`, and the path `(n, 2)` near them.

    Small maps are enlarged, large ones shrunk. Pieces of a long map go from left to right, or from bottom to top.
    """
    box = _box_of(grid, path_xy, whole)
    height, width = int(box[1] - box[0]), int(box[3] - box[2])
    long, short = max(height, width), min(height, width)
    pieces = _number_of_pieces(long, short)
    length = -(-long // pieces)
    zoom = _zoom_of(max(length, pieces * short))
    windows = []
    for index in range(pieces):
        part = box.copy()
        first = 2 if width >= height else 0
        part[first] = box[first] + index * length
        part[first + 1] = min(part[first] + length, box[first + 1]) if pieces == 1 else part[first] + length
        windows.append(_window(grid.geometry, part, zoom, MIN_SIDE_PX if pieces == 1 else MIN_PIECE_PX))
    return windows


def _number_of_pieces(long: int, short: int) -> int:
    """The pieces of a map with these sides (cells) with which the sheet has the best shape; 1 for a map that is not long."""
    if long <= MIN_DIVIDED_RATIO * short:
        return 1

    def misfit(pieces: int) -> float:
        length = -(-long // pieces)
        zoom = _zoom_of(max(length, pieces * short))
        side = max(short * zoom + 2 * MARGIN_PX, MIN_PIECE_PX) + AXIS_RATIO * length * zoom
        return abs(float(np.log(length * zoom / (pieces * side) / SHEET_RATIO)))

    return min(range(1, MAX_PIECES + 1), key=misfit)


def _zoom_of(side: int) -> float:
    """Pixels a cell for a sheet whose longer side has `side` cells."""
    shrink = -(-side // SHRINK_TO_PX)
    return 1.0 / shrink if shrink > 1 else float(min(max(ENLARGE_TO_PX // max(side, 1), 1), MAX_CELL_PX))


def _box_of(grid: OccupancyGrid, path_xy: Floats, whole: bool) -> Box:
    """The known cells and the part of the path that lies near them."""
    in_rows, in_cols = _known_cells(grid, whole)
    box = np.array([*_extent(in_rows), *_extent(in_cols)])
    if len(path_xy):
        cells = grid_coordinates(grid.geometry, path_xy)
        # Parts of the path far from the map are left out: they would shrink the map to a dot.
        max_distance = 2 * max(box[1] - box[0], box[3] - box[2], 50)
        inside = cells[(np.abs(cells - [box[2:].mean(), box[:2].mean()]) < max_distance).all(axis=1)]
        if len(inside):
            lo, hi = np.floor(inside.min(axis=0)).astype(int), np.ceil(inside.max(axis=0)).astype(int)
            box = np.array([min(box[0], lo[1]), max(box[1], hi[1]), min(box[2], lo[0]), max(box[3], hi[0])])
    return box.astype(np.int64)


def _known_cells(grid: OccupancyGrid, whole: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The number of known cells, or of all cells if `whole`, in each row and in each column."""
    rows, cols = grid.probability.shape
    in_rows, in_cols = np.full(rows, cols), np.full(cols, rows)
    if not whole:
        in_cols[:] = 0
        for first in range(0, rows, ROWS_AT_ONCE):
            known = ~np.isnan(grid.probability[first : first + ROWS_AT_ONCE])
            in_rows[first : first + ROWS_AT_ONCE] = known.sum(axis=1)
            in_cols += known.sum(axis=0)
    return in_rows, in_cols


def _extent(counts: NDArray[np.int64]) -> tuple[int, int]:
    """First and one past the last row with known cells; a few far away, such as readings through a window, are left out."""
    filled = np.flatnonzero(counts)
    if not len(filled):
        return 0, 1
    below = np.cumsum(counts) / counts.sum()
    near = np.flatnonzero((below > OUTLIER_RATIO) & (np.r_[0.0, below[:-1]] < 1.0 - OUTLIER_RATIO))
    slack = round(OUTLIER_EXTENT * (near[-1] + 1 - near[0]))
    first = filled[0] if near[0] - filled[0] <= slack else near[0]
    last = filled[-1] if filled[-1] - near[-1] <= slack else near[-1]
    return int(first), int(last) + 1


def _window(geometry: GridGeometry, box: Box, zoom: float, min_side_px: int) -> MapWindow:
    """The window of a box with a margin, of a smallest size, and a whole number of pixels."""
    margin = int(np.ceil(MARGIN_PX / zoom))
    smallest = int(np.ceil(min_side_px / zoom))
    shrink = round(1.0 / zoom) if zoom < 1.0 else 1
    ends = []
    for first, last in ((box[0], box[1]), (box[2], box[3])):
        count = int(last - first) + 2 * margin
        extra = max(smallest - count, 0)
        count = -(-(count + extra) // shrink) * shrink
        start = int(first) - margin - extra // 2
        ends += [start, start + count]
    return MapWindow(geometry=geometry, row0=ends[0], row1=ends[1], col0=ends[2], col1=ends[3], zoom=zoom)
