"""Log-odds insertion of beams, into copy-on-write tiles (one map per particle) and into one dense grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.grid_traversal import advance, start_traversal, steps_to
from gridslam.kernels.grids.tiles import TILE_BITS, TILE_MASK, ScanSet, TileMap, TileMaps, map_of
from gridslam.kernels.threads import run_in_ranges


class LogOddsUpdate(NamedTuple):
    """Log-odds added to the cell of an endpoint (`hit` > 0) and to a crossed cell (`miss` < 0), clamped to +-`limit`."""

    hit: float
    miss: float
    limit: float


class BeamBundle(NamedTuple):
    """Beams from `origin` (2,) to `endpoints` `(m, 2)`."""

    origin: NDArray[np.float64]
    endpoints: NDArray[np.float64]


@compiled
def _add(tile_map: TileMap, row: int, col: int, step: float, limit: float) -> None:
    """Add to the log-odds of one cell, if the map has a tile for it."""
    directory, origin = tile_map.directory, tile_map.origin
    t_row, t_col = (row >> TILE_BITS) - origin[0], (col >> TILE_BITS) - origin[1]
    if t_row < 0 or t_col < 0 or t_row >= directory.shape[0] or t_col >= directory.shape[1]:
        return
    tile = directory[t_row, t_col]
    if tile >= 0:
        # Indexed directly: a view of the cell would count a reference for every cell, which takes three times as long.
        r, c = row & TILE_MASK, col & TILE_MASK
        tile_map.pool[tile, r, c, 0] = min(max(tile_map.pool[tile, r, c, 0] + step, -limit), limit)


@compiled
def insert_beams(
    tile_map: TileMap, pose: NDArray[np.float64], beams: BeamBundle, update: LogOddsUpdate
) -> None:
    """Add `hit` to the cells of the endpoints and `miss` to the crossed cells, by exact cell traversal (Amanatides and Woo 1987).

    The beams are in the robot's frame and seen from `pose` (3,).
    """
    viewpoint, points, resolution_m = beams.origin, beams.endpoints, tile_map.resolution_m
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x0 = (pose[0] + c * viewpoint[0] - s * viewpoint[1]) / resolution_m
    y0 = (pose[1] + s * viewpoint[0] + c * viewpoint[1]) / resolution_m
    for i in range(points.shape[0]):
        x1 = (pose[0] + c * points[i, 0] - s * points[i, 1]) / resolution_m
        y1 = (pose[1] + s * points[i, 0] + c * points[i, 1]) / resolution_m
        endpoint_row, endpoint_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        for _ in range(steps_to(line, endpoint_row, endpoint_col)):
            _add(tile_map, line.row, line.col, update.miss, update.limit)
            line = advance(line)
        _add(tile_map, endpoint_row, endpoint_col, update.hit, update.limit)


@compiled
def insert_beams_of_scans(
    tile_map: TileMap,
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    scans: ScanSet,
    update: LogOddsUpdate,
) -> None:
    """`insert_beams` of many scans, seen from `poses` `(s, 3)`, into one map; `viewpoint` (2,) is the lidar's position."""
    for i in range(poses.shape[0]):
        own = scans.points[scans.first_point[i] : scans.first_point[i + 1]]
        insert_beams(tile_map, poses[i], BeamBundle(viewpoint, own), update)


def insert_beams_all(
    maps: TileMaps, poses: NDArray[np.float64], beams: BeamBundle, update: LogOddsUpdate
) -> None:
    """`insert_beams` for every particle, at its pose `(n, 3)`, into its own map."""
    run_in_ranges(_insert_beams_all, poses.shape[0], (maps, poses, beams, update))


@compiled
def _insert_beams_all(
    first: int,
    last: int,
    maps: TileMaps,
    poses: NDArray[np.float64],
    beams: BeamBundle,
    update: LogOddsUpdate,
) -> None:
    """Fill in the items first to last - 1 of `insert_beams_all`."""
    for k in range(first, last):
        insert_beams(map_of(maps, k), poses[k], beams, update)


@compiled
def _added(log_odds: float, step: float, limit: float) -> float:
    """The log-odds of a cell after one more update; NaN of a cell that nothing has changed yet counts as 0."""
    before = 0.0 if np.isnan(log_odds) else log_odds
    return min(max(before + step, -limit), limit)


@compiled
def insert_scan_dense(
    log_odds: NDArray[np.float32],
    last_update: NDArray[np.uint8],
    scan_number: int,
    beams: BeamBundle,
    is_hit: NDArray[np.bool_],
    update: LogOddsUpdate,
) -> None:
    """Insert one scan into a dense grid (rows, cols): a cell changes at most once per scan, and a hit overrides a miss.

    The beams are in cells (x, y) from the grid's lower-left corner; `is_hit` `(m,)` marks those that met something at their
    endpoint. `log_odds` (rows, cols) is changed by `update`. `last_update` (rows, cols) holds the `scan_number` of the scan that
    changed a cell last: no two scans have the same number until it is cleared to 0.
    """
    hit, miss, limit = update.hit, update.miss, update.limit
    ends_cells = beams.endpoints
    rows, cols = log_odds.shape
    for i in range(ends_cells.shape[0]):
        if not is_hit[i]:
            continue
        row, col = int(np.floor(ends_cells[i, 1])), int(np.floor(ends_cells[i, 0]))
        if 0 <= row < rows and 0 <= col < cols and last_update[row, col] != scan_number:
            last_update[row, col] = scan_number
            log_odds[row, col] = _added(log_odds[row, col], hit, limit)
    x0, y0 = beams.origin[0], beams.origin[1]
    for i in range(ends_cells.shape[0]):
        x1, y1 = ends_cells[i, 0], ends_cells[i, 1]
        endpoint_row, endpoint_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        for _ in range(steps_to(line, endpoint_row, endpoint_col)):
            row, col = line.row, line.col
            if 0 <= row < rows and 0 <= col < cols and last_update[row, col] != scan_number:
                last_update[row, col] = scan_number
                log_odds[row, col] = _added(log_odds[row, col], miss, limit)
            line = advance(line)
