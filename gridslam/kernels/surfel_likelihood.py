"""How likely a scan's end points are, given a map of surface elements and the log-odds of the space before them."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel
from gridslam.kernels.surfels import NX, NY, X, Y, nearest_surfel
from gridslam.kernels.tiles import TILE_BITS, TILE_MASK

SURELY_OCCUPIED = 1.5  # log-odds of a cell that no beam should have passed


@compiled
def _log_odds_at(
    directory: NDArray[np.int32], pool: NDArray[np.float32], origin: NDArray[np.int64], row: int, col: int
) -> float:
    """Log-odds of one cell of one map, 0 where nothing was written."""
    t_row, t_col = (row >> TILE_BITS) - origin[0], (col >> TILE_BITS) - origin[1]
    if t_row < 0 or t_row >= directory.shape[0] or t_col < 0 or t_col >= directory.shape[1]:
        return 0.0
    tile = directory[t_row, t_col]
    return float(pool[tile, row & TILE_MASK, col & TILE_MASK, 0]) if tile >= 0 else 0.0


@compiled
def _passes_wall(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    x0: float,
    y0: float,
    x1: float,
    y1: float,
    margin_m: float,
) -> bool:
    """Whether the way from (x0, y0) to `margin_m` before (x1, y1) leads through a cell that is surely occupied."""
    length = np.sqrt((x1 - x0) ** 2 + (y1 - y0) ** 2)
    steps = int((length - margin_m) / resolution_m)
    for k in range(1, steps + 1):
        t = k * resolution_m / length
        row = int(np.floor((y0 + t * (y1 - y0)) / resolution_m))
        col = int(np.floor((x0 + t * (x1 - x0)) / resolution_m))
        if _log_odds_at(directory, pool, origin, row, col) > SURELY_OCCUPIED:
            return True
    return False


@compiled
def log_likelihood(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    pose: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    random_share: float,
    free_directory: NDArray[np.int32],
    free_pool: NDArray[np.float32],
    free_origin: NDArray[np.int64],
    free_resolution_m: float,
) -> float:
    """Log likelihood of the end points seen from `pose`, given the surfaces and the log-odds of one map.

    An end point at distance e from a surface: log((1 - random_share) exp(-e^2 / (2 sigma^2)) + random_share). One with no
    surface in reach: the same at e = inf where the map knows the place to be free or has a wall before it; where it
    knows nothing, the value at e = sigma, so that new ground says nothing for or against a pose.
    """
    total = 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    miss = np.log(random_share)
    neutral = np.log((1.0 - random_share) * np.exp(-0.5) + random_share)
    x0 = pose[0] + c * viewpoint[0] - s * viewpoint[1]
    y0 = pose[1] + s * viewpoint[0] + c * viewpoint[1]
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        nx = c * normals[i, 0] - s * normals[i, 1]
        ny = s * normals[i, 0] + c * normals[i, 1]
        tile, row, col = nearest_surfel(directory, pool, origin, resolution_m, x, y, nx, ny, reach_m)
        if tile >= 0:
            cell = pool[tile, row, col]
            scale = 1.0 / np.sqrt(cell[NX] * cell[NX] + cell[NY] * cell[NY])
            e = scale * (cell[NX] * (x - cell[X]) + cell[NY] * (y - cell[Y]))
            total += np.log((1.0 - random_share) * np.exp(-0.5 * (e / sigma_m) ** 2) + random_share)
            continue
        f_row, f_col = int(np.floor(y / free_resolution_m)), int(np.floor(x / free_resolution_m))
        if _log_odds_at(free_directory, free_pool, free_origin, f_row, f_col) < 0.0 or _passes_wall(
            free_directory, free_pool, free_origin, free_resolution_m, x0, y0, x, y, reach_m
        ):
            total += miss
        else:
            total += neutral
    return total


@compiled_parallel
def log_likelihood_all(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    poses: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    random_share: float,
    free_directory: NDArray[np.int32],
    free_pool: NDArray[np.float32],
    free_origin: NDArray[np.int64],
    free_resolution_m: float,
) -> NDArray[np.float64]:
    """`log_likelihood` for every particle `(n, 3)` in its own map; `(n,)`."""
    n = poses.shape[0]
    out = np.empty(n)
    for k in prange(n):
        out[k] = log_likelihood(
            directory[k],
            pool,
            origin,
            resolution_m,
            viewpoint,
            points,
            normals,
            poses[k],
            sigma_m,
            reach_m,
            random_share,
            free_directory[k],
            free_pool,
            free_origin,
            free_resolution_m,
        )
    return out
