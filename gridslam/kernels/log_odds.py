"""Log-odds insertion of beams: into copy-on-write tiles (one map a particle) and into one dense grid."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel
from gridslam.kernels.grid_traversal import advance, start_traversal, steps_to
from gridslam.kernels.tiles import TILE_BITS, TILE_MASK


@compiled
def _add(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    row: int,
    col: int,
    step: float,
    limit: float,
) -> None:
    t_row, t_col = (row >> TILE_BITS) - origin[0], (col >> TILE_BITS) - origin[1]
    if t_row < 0 or t_col < 0 or t_row >= directory.shape[0] or t_col >= directory.shape[1]:
        return
    tile = directory[t_row, t_col]
    if tile >= 0:
        # Indexed directly: a view of the cell would count a reference for every cell, which takes three times as long.
        r, c = row & TILE_MASK, col & TILE_MASK
        pool[tile, r, c, 0] = min(max(pool[tile, r, c, 0] + step, -limit), limit)


@compiled
def insert_beams(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    pose: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """Add `hit` to the cells where the beams end and `miss` to those they cross, by exact cell traversal.

    `viewpoint` (2,) and the points `(m, 2)` are in the robot's frame, log-odds are held within +-limit. Amanatides
    and Woo 1987.
    """
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x0 = (pose[0] + c * viewpoint[0] - s * viewpoint[1]) / resolution_m
    y0 = (pose[1] + s * viewpoint[0] + c * viewpoint[1]) / resolution_m
    for i in range(points.shape[0]):
        x1 = (pose[0] + c * points[i, 0] - s * points[i, 1]) / resolution_m
        y1 = (pose[1] + s * points[i, 0] + c * points[i, 1]) / resolution_m
        end_row, end_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        for _ in range(steps_to(line, end_row, end_col)):
            _add(directory, pool, origin, line.row, line.col, miss, limit)
            line = advance(line)
        _add(directory, pool, origin, end_row, end_col, hit, limit)


@compiled
def insert_beam_trail(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    first_point: NDArray[np.int64],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """`insert_beams` of scan after scan into one map: scan i owns points[first_point[i]:first_point[i + 1]]."""
    for i in range(poses.shape[0]):
        own = points[first_point[i] : first_point[i + 1]]
        insert_beams(directory, pool, origin, resolution_m, poses[i], viewpoint, own, hit, miss, limit)


@compiled_parallel
def insert_beams_all(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    poses: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    points: NDArray[np.float64],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """`insert_beams` for every particle into its own map, whose tiles are its own already."""
    for k in prange(poses.shape[0]):
        insert_beams(directory[k], pool, origin, resolution_m, poses[k], viewpoint, points, hit, miss, limit)


@compiled
def insert_scan_dense(
    log_odds: NDArray[np.float32],
    touched: NDArray[np.int32],
    scan_number: int,
    pose_cells: NDArray[np.float64],
    ends_cells: NDArray[np.float64],
    is_hit: NDArray[np.bool_],
    hit: float,
    miss: float,
    limit: float,
) -> None:
    """One scan into a dense grid (rows, cols): every cell is changed once at most, and a hit beats a miss.

    `pose_cells` (2,) and `ends_cells` `(m, 2)` are x, y in cells from the grid's corner; `touched` (rows, cols) keeps, for
    the caller, which scan changed a cell last (scan_number > 0, growing by 1).
    """
    rows, cols = log_odds.shape
    for i in range(ends_cells.shape[0]):
        if not is_hit[i]:
            continue
        row, col = int(np.floor(ends_cells[i, 1])), int(np.floor(ends_cells[i, 0]))
        if 0 <= row < rows and 0 <= col < cols and touched[row, col] != scan_number:
            touched[row, col] = scan_number
            log_odds[row, col] = min(max(log_odds[row, col] + hit, -limit), limit)
    x0, y0 = pose_cells[0], pose_cells[1]
    for i in range(ends_cells.shape[0]):
        x1, y1 = ends_cells[i, 0], ends_cells[i, 1]
        end_row, end_col = int(np.floor(y1)), int(np.floor(x1))
        line = start_traversal(x0, y0, x1, y1)
        for _ in range(steps_to(line, end_row, end_col)):
            row, col = line.row, line.col
            if 0 <= row < rows and 0 <= col < cols and touched[row, col] != scan_number:
                touched[row, col] = scan_number
                log_odds[row, col] = min(max(log_odds[row, col] + miss, -limit), limit)
            line = advance(line)
