"""Maps of surface elements on copy-on-write tiles.

A cell keeps one surface element: how often it was hit, the mean point and the mean unit normal of the hits (channels
COUNT, X, Y, NX, NY). Averaging over hits takes out the range noise and the quantisation that single scans have.
"""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel
from gridslam.kernels.tiles import TILE_BITS, TILE_MASK

CHANNELS = 5
COUNT, X, Y, NX, NY = range(CHANNELS)
MAX_COUNT = 50.0  # later hits keep some weight
REPLACEABLE_COUNT = 3.0  # a surface facing the other way replaces one hit no more often than this
MIN_NORMAL_AGREEMENT = 0.6  # cosine
MAX_SEARCH_CELLS = 4


@compiled
def insert_surfels(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    pose: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> None:
    """Add the points `(m, 2)` with normals (zero normals are passed over), seen from `pose`, to one map's own tiles."""
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
        cell = pool[tile, row & TILE_MASK, col & TILE_MASK]
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
def insert_surfel_trail(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    poses: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    first_point: NDArray[np.int64],
) -> None:
    """`insert_surfels` of scan after scan into one map: scan i owns points[first_point[i]:first_point[i + 1]]."""
    for i in range(poses.shape[0]):
        lo, hi = first_point[i], first_point[i + 1]
        insert_surfels(directory, pool, origin, resolution_m, poses[i], points[lo:hi], normals[lo:hi])


@compiled_parallel
def insert_surfels_all(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    poses: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
) -> None:
    """`insert_surfels` for every particle into its own map, whose tiles are its own already."""
    for k in prange(poses.shape[0]):
        insert_surfels(directory[k], pool, origin, resolution_m, poses[k], points, normals)


@compiled
def nearest_surfel(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    x: float,
    y: float,
    nx: float,
    ny: float,
    reach_m: float,
) -> tuple[int, int, int]:
    """(tile, row, col) of the nearest surface element within reach that faces the same way; tile -1 for none."""
    span_m = min(reach_m, MAX_SEARCH_CELLS * resolution_m)
    row_0, row_1 = int(np.floor((y - span_m) / resolution_m)), int(np.floor((y + span_m) / resolution_m))
    col_0, col_1 = int(np.floor((x - span_m) / resolution_m)), int(np.floor((x + span_m) / resolution_m))
    best = reach_m * reach_m
    b_tile, b_row, b_col = -1, 0, 0
    has_normal = nx != 0.0 or ny != 0.0
    for r in range(row_0, row_1 + 1):
        t_row = (r >> TILE_BITS) - origin[0]
        if t_row < 0 or t_row >= directory.shape[0]:
            continue
        for q in range(col_0, col_1 + 1):
            t_col = (q >> TILE_BITS) - origin[1]
            if t_col < 0 or t_col >= directory.shape[1]:
                continue
            tile = directory[t_row, t_col]
            if tile < 0:
                continue
            cell = pool[tile, r & TILE_MASK, q & TILE_MASK]
            if cell[COUNT] <= 0.0:
                continue
            dx, dy = cell[X] - x, cell[Y] - y
            d = dx * dx + dy * dy
            if d < best:
                if has_normal and cell[NX] * nx + cell[NY] * ny < MIN_NORMAL_AGREEMENT:
                    continue
                best = d
                b_tile, b_row, b_col = tile, r & TILE_MASK, q & TILE_MASK
    return b_tile, b_row, b_col
