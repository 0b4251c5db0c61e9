"""Maps of surface elements on copy-on-write tiles.

A cell stores one surface element: the number of hits, and the mean point and mean unit normal of the hits (channels
COUNT, X, Y, NX, NY). Averaging over the hits removes the range noise and the quantisation of single scans.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.tiles import TILE_BITS, TILE_MASK, ScanSet, TileMap, TileMaps, map_of
from gridslam.kernels.threads import run_in_ranges

CHANNELS = 5
COUNT, X, Y, NX, NY = range(CHANNELS)
MAX_COUNT = 50.0  # bounds the weight of old hits: a new one moves the mean by at least 1 / MAX_COUNT
REPLACEABLE_COUNT = 3.0  # a surface that faces the other way replaces one with at most this many hits
MIN_NORMAL_AGREEMENT = 0.6  # cosine of the angle between the normals of corresponding surfaces
MAX_SEARCH_CELLS = 4


class OrientedPoints(NamedTuple):
    """Points `(m, 2)` and their unit normals `(m, 2)` in the robot's frame; a zero normal is unknown."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]


@compiled
def insert_surfels(tile_map: TileMap, pose: NDArray[np.float64], scan: OrientedPoints) -> None:
    """Add a scan, seen from `pose` (3,), to one map whose tiles are writable; points with unknown normals are skipped."""
    points, normals = scan.points, scan.normals
    directory, origin, resolution_m = tile_map.directory, tile_map.origin, tile_map.resolution_m
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(points.shape[0]):
        if normals[i, 0] == 0.0 and normals[i, 1] == 0.0:
            continue
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        nx = c * normals[i, 0] - s * normals[i, 1]
        ny = s * normals[i, 0] + c * normals[i, 1]
        row, col = int(np.floor(y / resolution_m)), int(np.floor(x / resolution_m))
        t_row, t_col = (row >> TILE_BITS) - origin[0], (col >> TILE_BITS) - origin[1]
        if t_row < 0 or t_col < 0 or t_row >= directory.shape[0] or t_col >= directory.shape[1]:
            continue
        tile = directory[t_row, t_col]
        if tile < 0:
            continue
        cell = tile_map.pool[tile, row & TILE_MASK, col & TILE_MASK]
        if cell[COUNT] > 0.0 and cell[NX] * nx + cell[NY] * ny < 0.0:
            if cell[COUNT] > REPLACEABLE_COUNT:
                continue
            cell[COUNT] = 0.0
        n = min(cell[COUNT] + 1.0, MAX_COUNT)
        k = 1.0 / n
        if n == 1.0:
            cell[X], cell[Y], cell[NX], cell[NY] = x, y, nx, ny
        else:
            cell[X] += k * (x - cell[X])
            cell[Y] += k * (y - cell[Y])
            cell[NX] += k * (nx - cell[NX])
            cell[NY] += k * (ny - cell[NY])
        cell[COUNT] = n


@compiled
def insert_surfels_of_scans(tile_map: TileMap, poses: NDArray[np.float64], scans: ScanSet) -> None:
    """`insert_surfels` of many scans, seen from `poses` `(s, 3)`, into one map."""
    for i in range(poses.shape[0]):
        lo, hi = scans.first_point[i], scans.first_point[i + 1]
        insert_surfels(tile_map, poses[i], OrientedPoints(scans.points[lo:hi], scans.normals[lo:hi]))


def insert_surfels_all(maps: TileMaps, poses: NDArray[np.float64], scan: OrientedPoints) -> None:
    """`insert_surfels` for every particle, at its pose `(n, 3)`, into its own map."""
    run_in_ranges(_insert_surfels_all, poses.shape[0], (maps, poses, scan))


@compiled
def _insert_surfels_all(
    first: int,
    last: int,
    maps: TileMaps,
    poses: NDArray[np.float64],
    scan: OrientedPoints,
) -> None:
    """Fill in the items first to last - 1 of `insert_surfels_all`."""
    for k in range(first, last):
        insert_surfels(map_of(maps, k), poses[k], scan)


@compiled
def nearest_surfel(
    tile_map: TileMap, x: float, y: float, nx: float, ny: float, max_distance_m: float
) -> tuple[int, int, int]:
    """(tile, row, col) of the surface element nearest to (x, y) that faces the same way as (nx, ny); tile -1 if there is none.

    `tile_map` is a map of surface elements; elements farther than `max_distance_m` are ignored.
    """
    directory, pool, origin = tile_map.directory, tile_map.pool, tile_map.origin
    size = tile_map.resolution_m
    span_m = min(max_distance_m, MAX_SEARCH_CELLS * size)
    per_m = 1.0 / size
    row_0, row_1 = int(np.floor((y - span_m) * per_m)), int(np.floor((y + span_m) * per_m))
    col_0, col_1 = int(np.floor((x - span_m) * per_m)), int(np.floor((x + span_m) * per_m))
    own_row, own_col = int(np.floor(y / size)), int(np.floor(x / size))
    best = max_distance_m * max_distance_m
    b_tile, b_row, b_col = -1, 0, 0
    has_normal = nx != 0.0 or ny != 0.0
    # The point's own row and column come first: what is found there excludes most of the others, as elements lie in their cells.
    for i in range(row_0 - 1, row_1 + 1):
        r = own_row if i < row_0 else i
        t_row = (r >> TILE_BITS) - origin[0]
        row_gap = max(r * size - y, y - (r + 1) * size, 0.0)
        if (i == own_row) or t_row < 0 or t_row >= directory.shape[0] or row_gap * row_gap >= best:
            continue
        for j in range(col_0 - 1, col_1 + 1):
            q = own_col if j < col_0 else j
            col_gap = max(q * size - x, x - (q + 1) * size, 0.0)
            if j == own_col or row_gap * row_gap + col_gap * col_gap >= best:
                continue
            t_col = (q >> TILE_BITS) - origin[1]
            if t_col < 0 or t_col >= directory.shape[1]:
                continue
            tile = directory[t_row, t_col]
            if tile < 0:
                continue
            row, col = r & TILE_MASK, q & TILE_MASK
            if pool[tile, row, col, COUNT] <= 0.0:
                continue
            dx, dy = pool[tile, row, col, X] - x, pool[tile, row, col, Y] - y
            d = dx * dx + dy * dy
            if d < best:
                agreement = pool[tile, row, col, NX] * nx + pool[tile, row, col, NY] * ny
                if has_normal and agreement < MIN_NORMAL_AGREEMENT:
                    continue
                best = d
                b_tile, b_row, b_col = tile, row, col
    return b_tile, b_row, b_col
