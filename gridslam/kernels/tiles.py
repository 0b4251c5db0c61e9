"""Copy-on-write tiles: which tile of which map holds a cell, and who owns it.

A cell of the plane has signed integer coordinates (row, col) = floor((y, x) / resolution). A map is a window of tile
numbers, `directory[map, tile_row - origin_row, tile_col - origin_col]`, -1 where nothing was written yet. Several maps may hold
the same tile; `refcount[tile]` counts them, and a tile is copied before a map that shares it writes to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grid_traversal import advance, start_traversal, steps_to

TILE_BITS = 3
TILE_CELLS = 1 << TILE_BITS  # 8 x 8 cells
TILE_MASK = TILE_CELLS - 1


@compiled
def reach_of(points: NDArray[np.float64]) -> float:
    """The largest distance of the points `(m, 2)` from the origin; infinity when one is not finite."""
    largest = 0.0
    for i in range(points.shape[0]):
        squared = points[i, 0] ** 2 + points[i, 1] ** 2
        if not squared < np.inf:
            return np.inf
        largest = max(largest, squared)
    return float(np.sqrt(largest))


@compiled
def mark_end_tiles(
    wanted: NDArray[np.bool_],
    origin: NDArray[np.int64],
    pose: NDArray[np.float64],
    points: NDArray[np.float64],
    resolution_m: float,
) -> None:
    """Mark in `wanted` (rows, cols) the tiles in which the points `(m, 2)`, seen from `pose`, end."""
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
    """Mark the tiles that the beams from `viewpoint` (2,) to the points `(m, 2)` cross (see `grid_traversal`)."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    tile_m = resolution_m * TILE_CELLS
    x0 = (pose[0] + c * viewpoint[0] - s * viewpoint[1]) / tile_m
    y0 = (pose[1] + s * viewpoint[0] + c * viewpoint[1]) / tile_m
    for i in range(points.shape[0]):
        x1 = (pose[0] + c * points[i, 0] - s * points[i, 1]) / tile_m
        y1 = (pose[1] + s * points[i, 0] + c * points[i, 1]) / tile_m
        end_row, end_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        _mark(wanted, line.row - origin[0], line.col - origin[1])
        for _ in range(steps_to(line, end_row, end_col)):
            line = advance(line)
            _mark(wanted, line.row - origin[0], line.col - origin[1])
        _mark(wanted, end_row - origin[0], end_col - origin[1])


@compiled
def mark_trail_tiles(
    wanted: NDArray[np.bool_],
    origin: NDArray[np.int64],
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    first_point: NDArray[np.int64],
    resolution_m: float,
    with_beams: bool,
) -> None:
    """`mark_end_tiles` or `mark_beam_tiles` for scan after scan: scan i owns points[first_point[i]:first_point[i + 1]]."""
    for i in range(poses.shape[0]):
        own = points[first_point[i] : first_point[i + 1]]
        if with_beams:
            mark_beam_tiles(wanted, origin, poses[i], viewpoint, own, resolution_m)
        else:
            mark_end_tiles(wanted, origin, poses[i], own, resolution_m)


@compiled
def bounds_of(poses: NDArray[np.float64], reach_m: float) -> tuple[float, float, float, float]:
    """Least y and x, largest y and x within reach of the poses `(n, 3)`; not finite when a number is not."""
    lo_x = hi_x = poses[0, 0]
    lo_y = hi_y = poses[0, 1]
    for i in range(poses.shape[0]):
        if not np.isfinite(poses[i, 0] + poses[i, 1] + poses[i, 2]):
            return np.nan, np.nan, np.nan, np.nan
        lo_x, hi_x = min(lo_x, poses[i, 0]), max(hi_x, poses[i, 0])
        lo_y, hi_y = min(lo_y, poses[i, 1]), max(hi_y, poses[i, 1])
    return lo_y - reach_m, lo_x - reach_m, hi_y + reach_m, hi_x + reach_m


@compiled
def own_tiles(
    wanted: NDArray[np.bool_],
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    refcount: NDArray[np.int32],
    free: NDArray[np.int32],
    n_free: int,
) -> int:
    """Give one map's `directory` (rows, cols) a tile of its own wherever `wanted`; returns the free tiles left.

    New tiles are zero. The caller has made sure that enough tiles are free: at most one for each wanted tile.
    """
    for row in range(wanted.shape[0]):
        for col in range(wanted.shape[1]):
            if not wanted[row, col]:
                continue
            wanted[row, col] = False
            tile = directory[row, col]
            if tile >= 0 and refcount[tile] == 1:
                continue
            n_free -= 1
            new = free[n_free]
            if tile >= 0:
                pool[new] = pool[tile]
                refcount[tile] -= 1
            else:
                pool[new] = 0
            refcount[new] = 1
            directory[row, col] = new
    return n_free


@compiled
def own_for_maps(
    wanted: NDArray[np.bool_],
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    refcount: NDArray[np.int32],
    free: NDArray[np.int32],
    n_free: int,
    origin: NDArray[np.int64],
    resolution_m: float,
    maps: NDArray[np.int64],
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    reach_m: float,
    with_beams: bool,
    begin: int,
) -> tuple[int, int, int]:
    """`own_tiles` for one scan in maps[begin:], seen from poses[k] in map maps[k], with the beams' tiles or the ends' alone.

    Stops at the first map for which too few tiles are free. Returns the free tiles left, how far it came (len(maps): all
    done), and how many tiles the next map needs. All points and the viewpoint lie within reach of the robot.
    """
    tile_m = resolution_m * TILE_CELLS
    for k in range(begin, maps.shape[0]):
        if with_beams:
            mark_beam_tiles(wanted, origin, poses[k], viewpoint, points, resolution_m)
        else:
            mark_end_tiles(wanted, origin, poses[k], points, resolution_m)
        row_0 = max(int(np.floor((poses[k, 1] - reach_m) / tile_m)) - origin[0] - 1, 0)
        col_0 = max(int(np.floor((poses[k, 0] - reach_m) / tile_m)) - origin[1] - 1, 0)
        row_1 = int(np.floor((poses[k, 1] + reach_m) / tile_m)) - origin[0] + 2
        col_1 = int(np.floor((poses[k, 0] + reach_m) / tile_m)) - origin[1] + 2
        window = wanted[row_0:row_1, col_0:col_1]
        held = directory[maps[k], row_0:row_1, col_0:col_1]
        needed = 0
        for row in range(window.shape[0]):
            for col in range(window.shape[1]):
                if window[row, col] and (held[row, col] < 0 or refcount[held[row, col]] > 1):
                    needed += 1
        if needed > n_free:
            return n_free, k, needed
        n_free = own_tiles(window, held, pool, refcount, free, n_free)
    return n_free, maps.shape[0], 0


@compiled
def redistribute(
    directory: NDArray[np.int32],
    ancestors: NDArray[np.int64],
    refcount: NDArray[np.int32],
    free: NDArray[np.int32],
    n_free: int,
) -> int:
    """Let map i become a copy of map ancestors[i]; tiles that no map holds any more become free. Returns their number."""
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
                    refcount[tile] += 1
    for i in range(n):
        if ancestors[i] == i:
            continue
        for row in range(rows):
            for col in range(cols):
                tile = old[i, row, col]
                if tile >= 0:
                    refcount[tile] -= 1
                    if refcount[tile] == 0:
                        free[n_free] = tile
                        n_free += 1
    return n_free
