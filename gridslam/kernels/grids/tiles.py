"""Copy-on-write tiles: the maps of many particles in one pool of small tiles.

A cell of the plane has signed integer coordinates (row, col) = floor((y, x) / resolution). A map is a window of tile
numbers, `directory[map, tile_row - origin_row, tile_col - origin_col]`, -1 where nothing has been written yet. Several maps
may share a tile. `refcount[tile]` counts them, and a shared tile is copied before one of its maps writes to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.grid_traversal import advance, start_traversal, steps_to

TILE_BITS = 3
TILE_CELLS = 1 << TILE_BITS  # 8 x 8 cells
TILE_MASK = TILE_CELLS - 1


class TileMap(NamedTuple):
    """One map: tile numbers `directory` int32 (rows, cols) and the shared tiles `pool` float32 (tiles, cells, cells, channels).

    `origin` int64 (2,) is the tile (row, col) of directory[0, 0]; a cell is `resolution_m` wide.
    """

    directory: NDArray[np.int32]
    pool: NDArray[np.float32]
    origin: NDArray[np.int64]
    resolution_m: float


class TileMaps(NamedTuple):
    """Many maps over one pool: as `TileMap`, with a `directory` int32 (maps, rows, cols)."""

    directory: NDArray[np.int32]
    pool: NDArray[np.float32]
    origin: NDArray[np.int64]
    resolution_m: float


class TilePool(NamedTuple):
    """Tiles `(tiles, cells, cells, channels)`, how many maps hold each `(tiles,)`, and a stack of free tiles `(tiles,)`."""

    tiles: NDArray[np.float32]
    refcount: NDArray[np.int32]
    free: NDArray[np.int32]


class ScanInMaps(NamedTuple):
    """One scan, seen from poses[k] `(n, 3)` in map maps[k] `(n,)`.

    `viewpoint` (2,) and `points` `(m, 2)` are in the robot's frame and lie within `radius_m` of its origin. `with_beams`:
    the tiles that the beams cross are written as well, not only those of their endpoints.
    """

    maps: NDArray[np.int64]
    poses: NDArray[np.float64]
    viewpoint: NDArray[np.float64]
    points: NDArray[np.float64]
    radius_m: float
    with_beams: bool


class ScanSet(NamedTuple):
    """Many scans: scan i owns points[first_point[i]:first_point[i + 1]] `(m, 2)` and their unit `normals` `(m, 2)`.

    Both are in the robot's frame of their scan; normals are zero where they are unknown or not needed.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    first_point: NDArray[np.int64]


@compiled
def map_of(maps: TileMaps, index: int) -> TileMap:
    """Map number `index` of many."""
    return TileMap(maps.directory[index], maps.pool, maps.origin, maps.resolution_m)


@compiled
def radius_of(points: NDArray[np.float64]) -> float:
    """Largest distance of the points `(m, 2)` from the origin; infinity if one of them is not finite."""
    largest = 0.0
    for i in range(points.shape[0]):
        squared = points[i, 0] ** 2 + points[i, 1] ** 2
        if not squared < np.inf:
            return np.inf
        largest = max(largest, squared)
    return float(np.sqrt(largest))


@compiled
def mark_endpoint_tiles(
    wanted: NDArray[np.bool_],
    origin: NDArray[np.int64],
    pose: NDArray[np.float64],
    points: NDArray[np.float64],
    resolution_m: float,
) -> None:
    """Mark in `wanted` (rows, cols) the tiles that contain the points `(m, 2)`, seen from `pose`."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        row = (int(np.floor(y / resolution_m)) >> TILE_BITS) - origin[0]
        col = (int(np.floor(x / resolution_m)) >> TILE_BITS) - origin[1]
        if 0 <= row < wanted.shape[0] and 0 <= col < wanted.shape[1]:
            wanted[row, col] = True


@compiled
def _mark(wanted: NDArray[np.bool_], row: int, col: int) -> None:
    if 0 <= row < wanted.shape[0] and 0 <= col < wanted.shape[1]:
        wanted[row, col] = True


@compiled
def mark_beam_tiles(
    wanted: NDArray[np.bool_],
    origin: NDArray[np.int64],
    pose: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    resolution_m: float,
) -> None:
    """Mark the tiles that the beams from `viewpoint` (2,) to the points `(m, 2)` cross (see `grid_traversal`).

    Viewpoint and points are in the robot's frame at `pose` (3,). `wanted` bool (rows, cols) begins with the tile `origin` (2,),
    and a cell is `resolution_m` wide.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    tile_m = resolution_m * TILE_CELLS
    x0 = (pose[0] + c * viewpoint[0] - s * viewpoint[1]) / tile_m
    y0 = (pose[1] + s * viewpoint[0] + c * viewpoint[1]) / tile_m
    for i in range(points.shape[0]):
        x1 = (pose[0] + c * points[i, 0] - s * points[i, 1]) / tile_m
        y1 = (pose[1] + s * points[i, 0] + c * points[i, 1]) / tile_m
        endpoint_row, endpoint_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        _mark(wanted, line.row - origin[0], line.col - origin[1])
        for _ in range(steps_to(line, endpoint_row, endpoint_col)):
            line = advance(line)
            _mark(wanted, line.row - origin[0], line.col - origin[1])
        _mark(wanted, endpoint_row - origin[0], endpoint_col - origin[1])


@compiled
def mark_tiles_of_scans(
    wanted: NDArray[np.bool_],
    tile_map: TileMap,
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    scans: ScanSet,
    with_beams: bool,
) -> None:
    """Mark the tiles of all scans, seen from `poses` `(s, 3)`: those of the endpoints, or those that the beams cross.

    `wanted` bool (rows, cols) has the rows and columns of `tile_map`. `viewpoint` (2,) is the lidar in the robot's frame;
    `with_beams` chooses the tiles that the beams cross.
    """
    origin, resolution_m = tile_map.origin, tile_map.resolution_m
    for i in range(poses.shape[0]):
        own = scans.points[scans.first_point[i] : scans.first_point[i + 1]]
        if with_beams:
            mark_beam_tiles(
                wanted, origin, poses[i], viewpoint=viewpoint, points=own, resolution_m=resolution_m
            )
        else:
            mark_endpoint_tiles(wanted, origin, poses[i], own, resolution_m)


@compiled
def bounds_of(poses: NDArray[np.float64], radius_m: float) -> tuple[float, float, float, float]:
    """Smallest y and x, largest y and x within a radius of the poses `(n, 3)`; NaN if a pose is not finite."""
    lo_x = hi_x = poses[0, 0]
    lo_y = hi_y = poses[0, 1]
    for i in range(poses.shape[0]):
        if not np.isfinite(poses[i, 0] + poses[i, 1] + poses[i, 2]):
            return np.nan, np.nan, np.nan, np.nan
        lo_x, hi_x = min(lo_x, poses[i, 0]), max(hi_x, poses[i, 0])
        lo_y, hi_y = min(lo_y, poses[i, 1]), max(hi_y, poses[i, 1])
    return lo_y - radius_m, lo_x - radius_m, hi_y + radius_m, hi_x + radius_m


@compiled
def _copy_tile(tiles: NDArray[np.float32], target: int, source: int) -> None:
    for row in range(tiles.shape[1]):
        for col in range(tiles.shape[2]):
            for channel in range(tiles.shape[3]):
                tiles[target, row, col, channel] = tiles[source, row, col, channel]


@compiled
def own_tiles(wanted: NDArray[np.bool_], directory: NDArray[np.int32], pool: TilePool, n_free: int) -> int:
    """Give one map's `directory` (rows, cols) a tile of its own wherever `wanted`; returns the number of free tiles left.

    New tiles are zero. The caller makes sure that at least one free tile is available per wanted tile.
    """
    for row in range(wanted.shape[0]):
        for col in range(wanted.shape[1]):
            if not wanted[row, col]:
                continue
            wanted[row, col] = False
            tile = directory[row, col]
            if tile >= 0 and pool.refcount[tile] == 1:
                continue
            n_free -= 1
            new = pool.free[n_free]
            if tile >= 0:
                _copy_tile(pool.tiles, new, tile)
                pool.refcount[tile] -= 1
            else:
                pool.tiles[new] = 0
            pool.refcount[new] = 1
            directory[row, col] = new
    return n_free


@compiled
def own_tiles_of_scan(
    wanted: NDArray[np.bool_],
    maps: TileMaps,
    pool: TilePool,
    n_free: int,
    scan: ScanInMaps,
    first: int,
) -> tuple[int, int, int]:
    """`own_tiles` for the scan's tiles in scan.maps[first:].

    `wanted` bool (rows, cols) is scratch space, and `n_free` tiles of the `pool` are free. Stops at the first map for
    which these are too few. Returns the number of free tiles left, the index at which it
    stopped (len(scan.maps): all done), and how many tiles the next map needs.
    """
    tile_m = maps.resolution_m * TILE_CELLS
    origin = maps.origin
    for k in range(first, scan.maps.shape[0]):
        pose = scan.poses[k]
        if scan.with_beams:
            mark_beam_tiles(
                wanted,
                origin,
                pose,
                viewpoint=scan.viewpoint,
                points=scan.points,
                resolution_m=maps.resolution_m,
            )
        else:
            mark_endpoint_tiles(wanted, origin, pose, scan.points, maps.resolution_m)
        row_0 = max(int(np.floor((pose[1] - scan.radius_m) / tile_m)) - origin[0] - 1, 0)
        col_0 = max(int(np.floor((pose[0] - scan.radius_m) / tile_m)) - origin[1] - 1, 0)
        row_1 = int(np.floor((pose[1] + scan.radius_m) / tile_m)) - origin[0] + 2
        col_1 = int(np.floor((pose[0] + scan.radius_m) / tile_m)) - origin[1] + 2
        window = wanted[row_0:row_1, col_0:col_1]
        held = maps.directory[scan.maps[k], row_0:row_1, col_0:col_1]
        needed = 0
        for row in range(window.shape[0]):
            for col in range(window.shape[1]):
                if window[row, col] and (held[row, col] < 0 or pool.refcount[held[row, col]] > 1):
                    needed += 1
        if needed > n_free:
            return n_free, k, needed
        n_free = own_tiles(window, held, pool, n_free)
    return n_free, scan.maps.shape[0], 0


@compiled
def redistribute(
    directory: NDArray[np.int32], ancestors: NDArray[np.int64], pool: TilePool, n_free: int
) -> int:
    """Make map i of `directory` (maps, rows, cols) a copy of map ancestors[i]; returns the number of free tiles.

    Tiles that no map holds any more become free.
    """
    old = directory.copy()
    n, rows, cols = directory.shape
    for i in range(n):
        if ancestors[i] == i:
            continue
        directory[i] = old[ancestors[i]]
        for row in range(rows):
            for col in range(cols):
                tile = directory[i, row, col]
                if tile >= 0:
                    pool.refcount[tile] += 1
    for i in range(n):
        if ancestors[i] == i:
            continue
        for row in range(rows):
            for col in range(cols):
                tile = old[i, row, col]
                if tile >= 0:
                    pool.refcount[tile] -= 1
                    if pool.refcount[tile] == 0:
                        pool.free[n_free] = tile
                        n_free += 1
    return n_free
