"""Maps cut out, turned and laid over each other; resolution and origin follow."""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid, marked_cells, values_under

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

OCCUPIED_FROM, FREE_UP_TO = 0.65, 0.196
WALL_CELLS = 3  # kept around what is reachable
MAX_CELLS = 64_000_000  # largest turned or merged map, 400 m x 400 m at 5 cm: less than 1 GB with all copies
BLOCK_CELLS = 1 << 18  # resampled at a time, in some 100 bytes each
# Largest number of wall cells by which their direction is found; of more, some at random
MAX_DIRECTION_CELLS = 500_000
COARSE_DEG, FINE_DEG = 0.5, 0.02  # steps of the search for the direction of the walls
MAX_LOG_ODDS = 6.0
CORNER_BITS = 4  # bits of a fraction of a cell, in which cv2 takes corners of polygons
OUTSIDE_CELLS = 2.0  # margin around the map beyond which a polygon is cut off


def crop_to_polygon(grid: OccupancyGrid, corners: Floats) -> OccupancyGrid:
    """The cells whose centres lie inside a polygon `(n, 2)` of the map frame. Raises ConfigError: no known cell does."""
    cells = _fractional_cells(grid.geometry, corners)[:, ::-1]
    mask = np.zeros(grid.probability.shape, np.uint8)
    corners_near = _clipped(cells, np.full(2, -OUTSIDE_CELLS), np.array(mask.shape[::-1]) + OUTSIDE_CELLS)
    shifted = np.rint(corners_near * (1 << CORNER_BITS)).astype(np.int32)
    if len(shifted):
        cv2.fillPoly(mask, [shifted], 1, shift=CORNER_BITS)
    return _kept(grid, mask.view(np.bool_), "the polygon holds no known cell of the map")


def _clipped(polygon: Floats, low: Floats, high: Floats) -> Floats:
    """The part of a polygon `(n, 2)` inside a box from `low` (2,) to `high` (2,); Sutherland and Hodgman 1974."""
    for axis in range(2):
        for bound, sign in ((low[axis], 1.0), (high[axis], -1.0)):
            beyond = sign * (polygon[:, axis] - bound)
            kept: list[Floats] = []
            for k in range(len(polygon)):
                before, here = beyond[k - 1], beyond[k]
                if (before < 0.0) != (here < 0.0):
                    kept.append(polygon[k - 1] + before / (before - here) * (polygon[k] - polygon[k - 1]))
                if here >= 0.0:
                    kept.append(polygon[k])
            polygon = np.array(kept).reshape(-1, 2)
    return polygon


def crop_to_reachable(grid: OccupancyGrid, start_xy: Floats) -> OccupancyGrid:
    """The part of a map that is reachable from a point (2,) over free cells, with the walls around it.

    The point is in the map frame (m). Raises ConfigError: it is not free.
    """
    row, col = grid.geometry.cells(start_xy[None])[0]
    rows, cols = grid.probability.shape
    if not (0 <= row < rows and 0 <= col < cols and grid.probability[row, col] <= FREE_UP_TO):
        raise ConfigError(f"the point {start_xy[0]:g}, {start_xy[1]:g} does not lie in free space of the map")
    return _kept(grid, _reachable(grid, (int(col), int(row))), "nothing is reachable")


def _reachable(grid: OccupancyGrid, col_row: tuple[int, int]) -> Bools:
    """Mask of the cells that can be reached from one over free cells, and the walls and cells in between around them."""
    cells = (grid.probability <= FREE_UP_TO).view(np.uint8)  # 1: free, later 2: reached
    cv2.floodFill(cells, None, col_row, 2, flags=4)
    kept = cv2.dilate((cells == 2).view(np.uint8), np.ones((2 * WALL_CELLS + 1,) * 2, np.uint8))
    np.copyto(kept, 0, where=cells == 1)
    return np.asarray(kept.view(np.bool_))


def _kept(grid: OccupancyGrid, mask: Bools, problem: str) -> OccupancyGrid:
    """The cells of a mask in the smallest grid that holds the known ones."""
    rows, cols = _extent(grid, problem, mask)
    part = _part(grid, rows, cols)
    values = np.array(part.probability, np.float32)
    for row, is_inside in zip(values, mask[rows, cols], strict=True):
        row[~is_inside] = np.nan
    return OccupancyGrid(values, part.geometry)


def trimmed(grid: OccupancyGrid, problem: str = "the map has no known cell") -> OccupancyGrid:
    """The map without unknown rows and columns at its borders, in the same memory. Raises ConfigError: no cell is known."""
    return _part(grid, *_extent(grid, problem))


def _extent(grid: OccupancyGrid, problem: str, mask: Bools | None = None) -> tuple[slice, slice]:
    """The rows and columns with a known cell, of the mask if there is one. Raises ConfigError: there is none."""
    in_row, in_col = (np.zeros(size, np.bool_) for size in grid.probability.shape)
    for row, values in enumerate(grid.probability):  # all at once take a quarter of a large map's memory
        known = ~np.isnan(values) if mask is None else mask[row] & ~np.isnan(values)
        in_row[row] = known.any()
        in_col |= known
    rows, cols = np.flatnonzero(in_row), np.flatnonzero(in_col)
    if not len(rows):
        raise ConfigError(problem)
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(cols[0]), int(cols[-1]) + 1)


def _part(grid: OccupancyGrid, rows: slice, cols: slice) -> OccupancyGrid:
    """Some rows and columns."""
    x, y = grid.geometry.centres(np.array([[rows.start - 0.5, cols.start - 0.5]]))[0].tolist()
    geometry = GridGeometry(grid.geometry.resolution_m, (x, y), grid.geometry.yaw_rad)
    return OccupancyGrid(grid.probability[rows, cols], geometry)


def wall_direction(grid: OccupancyGrid) -> float:
    """The heading (rad, in [-pi/4, pi/4)) that most walls run along or across in the map frame. Raises ConfigError: no wall."""
    points = grid.geometry.centres(marked_cells(grid.probability > OCCUPIED_FROM))
    if not len(points):
        raise ConfigError("the map has no wall whose direction could be found")
    if len(points) > MAX_DIRECTION_CELLS:
        points = np.random.default_rng(0).choice(points, MAX_DIRECTION_CELLS, replace=False, shuffle=False)
    coarse = np.radians(np.arange(-45.0, 45.0, COARSE_DEG))
    best = coarse[int(np.argmax([_alignment(points, a, grid.geometry.resolution_m) for a in coarse]))]
    fine = best + np.radians(np.arange(-COARSE_DEG, COARSE_DEG + 1e-9, FINE_DEG))
    found = fine[int(np.argmax([_alignment(points, a, grid.geometry.resolution_m) for a in fine]))]
    return float((found + np.pi / 4) % (np.pi / 2) - np.pi / 4)


def _alignment(points: Floats, yaw_rad: float, cell_m: float) -> float:
    """Score of a rotation `yaw_rad`: high if points `(n, 2)` gather in few rows and columns of axes rotated by it."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    turned = points @ np.array([[c, -s], [s, c]])
    total = 0.0
    for axis in range(2):
        rows = np.floor((turned[:, axis] - turned[:, axis].min()) / cell_m).astype(np.int64)
        total += float((np.bincount(rows).astype(np.float64) ** 2).sum())
    return total


def moved(grid: OccupancyGrid, T_new_old: Floats) -> OccupancyGrid:
    """The map in another frame, given T_new_old `(3,)`, resampled on cells along its axes.

    Raises ConfigError: the map would be too large.
    """
    rows, cols = grid.probability.shape
    corners = np.array([(-0.5, -0.5), (-0.5, cols - 0.5), (rows - 0.5, -0.5), (rows - 0.5, cols - 0.5)])
    ends = se2.transform_points(T_new_old, grid.geometry.centres(corners))
    geometry, shape = _frame_around(ends, grid.geometry.resolution_m)
    return trimmed(OccupancyGrid(resampled(grid, T_new_old, geometry, shape), geometry))


def merged(base: OccupancyGrid, other: OccupancyGrid, T_base_other: Floats) -> OccupancyGrid:
    """Both maps in the frame and at the resolution of the first one; where both know a cell their log-odds are added.

    T_base_other `(3,)` is the pose of the other map's frame in that of the first one.     Raises ConfigError: the map would be
    too large.
    """
    ends = []
    for grid, pose in ((base, np.zeros(3)), (other, T_base_other)):
        rows, cols = grid.probability.shape
        corners = np.array([(-0.5, -0.5), (-0.5, cols - 0.5), (rows - 0.5, -0.5), (rows - 0.5, cols - 0.5)])
        ends.append(se2.transform_points(pose, grid.geometry.centres(corners)))
    geometry, shape = _frame_around(np.concatenate(ends), base.geometry.resolution_m)
    values = np.full(shape, np.nan, np.float32)  # log-odds first, then probabilities
    for grid, pose in ((base, np.zeros(3)), (other, T_base_other)):
        for part, seen in _resampled_parts(grid, pose, geometry, shape):
            values[part] = np.where(
                np.isnan(seen), values[part], np.nan_to_num(values[part]) + _log_odds(seen)
            )
    for row in values:  # by rows: a large map many times over would not fit into memory
        row[:] = 1.0 / (1.0 + np.exp(-np.clip(row, -MAX_LOG_ODDS, MAX_LOG_ODDS)))
    return trimmed(OccupancyGrid(values, geometry))


def resampled(
    grid: OccupancyGrid, T_new_old: Floats, geometry: GridGeometry, shape: tuple[int, int]
) -> NDArray[np.float32]:
    """Probabilities `shape` of the map's cells under the centres of another grid's cells; NaN outside the map."""
    values = np.full(shape, np.nan, np.float32)
    for part, seen in _resampled_parts(grid, T_new_old, geometry, shape):
        values[part] = seen
    return values


def _resampled_parts(
    grid: OccupancyGrid, T_new_old: Floats, geometry: GridGeometry, shape: tuple[int, int]
) -> Iterator[tuple[tuple[slice, slice], NDArray[np.float32]]]:
    """The parts of another grid that the map covers, each of some BLOCK_CELLS, with the map's probabilities there."""
    T_old_new = se2.inverse(T_new_old)
    rows, cols = grid.probability.shape
    corners = np.array([(-0.5, -0.5), (-0.5, cols - 0.5), (rows - 0.5, -0.5), (rows - 0.5, cols - 0.5)])
    covered = geometry.cells(se2.transform_points(T_new_old, grid.geometry.centres(corners)))
    low = np.clip(covered.min(axis=0) - 1, 0, shape)
    high = np.clip(covered.max(axis=0) + 2, low, shape)
    (first_row, first_col), (stop_row, stop_col) = low.tolist(), high.tolist()
    block = max(BLOCK_CELLS // max(stop_col - first_col, 1), 1)
    for first in range(first_row, stop_row, block):
        part = slice(first, min(first + block, stop_row)), slice(first_col, stop_col)
        yield part, values_under(grid, T_old_new, geometry, part)


def _frame_around(points: Floats, cell_m: float) -> tuple[GridGeometry, tuple[int, int]]:
    """A grid along the axes around points, whose corner lies on a multiple of the cell size."""
    low = np.floor(points.min(axis=0) / cell_m + 1e-9)
    size = np.ceil(points.max(axis=0) / cell_m - 1e-9) - low
    if not size.prod() <= MAX_CELLS:
        raise ConfigError(f"the map would have {size[0]:.9g} x {size[1]:.9g} cells; the limit is {MAX_CELLS}")
    x, y = (low * cell_m).tolist()
    return GridGeometry(cell_m, (x, y)), (int(size[1]), int(size[0]))


def _fractional_cells(geometry: GridGeometry, points: Floats) -> Floats:
    """Cells (row, col) of points, not rounded: a cell's centre is a whole number."""
    offset = points - np.asarray(geometry.origin_xy_m)
    c, s = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
    local = offset @ np.array([[c, -s], [s, c]]) / geometry.resolution_m
    return np.asarray(local[:, ::-1] - 0.5)


def _log_odds(probability: NDArray[np.float32]) -> Floats:
    p = np.clip(np.nan_to_num(probability.astype(np.float64), nan=0.5), 1e-3, 1.0 - 1e-3)
    return np.asarray(np.log(p / (1.0 - p)))
