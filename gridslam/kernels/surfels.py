"""Maps of surface elements on copy-on-write tiles: insertion, point-to-line registration, likelihood.

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
SURELY_OCCUPIED = 1.5  # log-odds of a cell that no beam should have passed
CONVERGED_M = 1e-4
CONVERGED_RAD = 1e-5


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


@compiled
def _nearest(
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


@compiled
def register(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    start: NDArray[np.float64],
    prior: NDArray[np.float64],
    prior_information: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    final_reach_m: float,
    iterations: int,
    least_used: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Gauss-Newton on the point-to-line distances to one map, robust, with a Gaussian prior on the pose.

    Minimises sum rho(n_k . (T p_i - q_k)) + (T - prior)' prior_information (T - prior), rho the Geman-McClure loss of
    scale `sigma_m`; the reach of a correspondence is halved every iteration from `reach_m` down to `final_reach_m`.
    With fewer than `least_used` correspondences it gives up.

    Returns the pose `(3,)`, the information of the scan alone at it `(3, 3)`, and the number of correspondences.
    """
    pose = start.copy()
    scan_information = np.zeros((3, 3))
    used = 0
    reach = reach_m
    for _ in range(iterations):
        scan_information[:] = 0.0
        g0 = g1 = g2 = 0.0
        c, s = np.cos(pose[2]), np.sin(pose[2])
        used = 0
        for i in range(points.shape[0]):
            rx = c * points[i, 0] - s * points[i, 1]
            ry = s * points[i, 0] + c * points[i, 1]
            nx = c * normals[i, 0] - s * normals[i, 1]
            ny = s * normals[i, 0] + c * normals[i, 1]
            x, y = pose[0] + rx, pose[1] + ry
            tile, row, col = _nearest(directory, pool, origin, resolution_m, x, y, nx, ny, reach)
            if tile < 0:
                continue
            cell = pool[tile, row, col]
            scale = 1.0 / np.sqrt(cell[NX] * cell[NX] + cell[NY] * cell[NY])
            mx, my = cell[NX] * scale, cell[NY] * scale
            e = mx * (x - cell[X]) + my * (y - cell[Y])
            w = 1.0 / (1.0 + (e / sigma_m) ** 2)
            w = w * w / (sigma_m * sigma_m)
            j = my * rx - mx * ry
            scan_information[0, 0] += w * mx * mx
            scan_information[0, 1] += w * mx * my
            scan_information[0, 2] += w * mx * j
            scan_information[1, 1] += w * my * my
            scan_information[1, 2] += w * my * j
            scan_information[2, 2] += w * j * j
            g0 += w * mx * e
            g1 += w * my * e
            g2 += w * j * e
            used += 1
        scan_information[1, 0] = scan_information[0, 1]
        scan_information[2, 0] = scan_information[0, 2]
        scan_information[2, 1] = scan_information[1, 2]
        off = pose - prior
        off[2] -= 2.0 * np.pi * np.round(off[2] / (2.0 * np.pi))
        gradient = np.array([g0, g1, g2]) + prior_information @ off
        step = np.linalg.solve(scan_information + prior_information, -gradient)
        pose += step
        if used < least_used:
            break
        settled = abs(step[0]) < CONVERGED_M and abs(step[1]) < CONVERGED_M and abs(step[2]) < CONVERGED_RAD
        if settled and reach <= final_reach_m:
            break
        reach = max(0.5 * reach, final_reach_m)
    return pose, scan_information, used


@compiled
def search_yaw(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    predicted: NDArray[np.float64],
    step_rad: float,
    steps: int,
    sigma_m: float,
    reach_m: float,
) -> NDArray[np.float64]:
    """The predicted pose turned by that multiple of `step_rad`, up to +-steps, at which most points lie on surfaces.

    A point at distance d from the nearest surface element within reach counts exp(-d^2 / (2 sigma^2)); of equal scores the
    smallest turn wins.
    """
    best_score = -1.0
    best_yaw = predicted[2]
    for k in range(2 * steps + 1):
        turn = ((k + 1) // 2) * step_rad * (1.0 if k % 2 else -1.0)
        yaw = predicted[2] + turn
        c, s = np.cos(yaw), np.sin(yaw)
        score = 0.0
        for i in range(points.shape[0]):
            x = predicted[0] + c * points[i, 0] - s * points[i, 1]
            y = predicted[1] + s * points[i, 0] + c * points[i, 1]
            nx = c * normals[i, 0] - s * normals[i, 1]
            ny = s * normals[i, 0] + c * normals[i, 1]
            tile, row, col = _nearest(directory, pool, origin, resolution_m, x, y, nx, ny, reach_m)
            if tile >= 0:
                cell = pool[tile, row, col]
                d2 = (x - cell[X]) ** 2 + (y - cell[Y]) ** 2
                score += np.exp(-0.5 * d2 / (sigma_m * sigma_m))
        if score > best_score:
            best_score = score
            best_yaw = yaw
    return np.array([predicted[0], predicted[1], best_yaw])


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
        tile, row, col = _nearest(directory, pool, origin, resolution_m, x, y, nx, ny, reach_m)
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
def register_all(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    starts: NDArray[np.float64],
    priors: NDArray[np.float64],
    prior_information: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    final_reach_m: float,
    iterations: int,
    least_used: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """`register` for every particle against its own map; `prior_information` `(n, 3, 3)` about the `priors` `(n, 3)`."""
    n = starts.shape[0]
    poses = np.empty((n, 3))
    information = np.empty((n, 3, 3))
    used = np.empty(n, np.int64)
    for k in prange(n):
        pose, info, count = register(
            directory[k],
            pool,
            origin,
            resolution_m,
            points,
            normals,
            starts[k],
            priors[k],
            prior_information[k],
            sigma_m,
            reach_m,
            final_reach_m,
            iterations,
            least_used,
        )
        poses[k] = pose
        information[k] = info
        used[k] = count
    return poses, information, used


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


@compiled_parallel
def register_pairs(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    maps: NDArray[np.int64],
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    first_point: NDArray[np.int64],
    scans: NDArray[np.int64],
    starts: NDArray[np.float64],
    prior_information: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    final_reach_m: float,
    iterations: int,
    least_used: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """`register` of scan scans[k] in map maps[k] from starts[k]: poses `(n, 3)`, information `(n, 3, 3)`, fit `(n,)`.

    Scan i owns points[first_point[i]:first_point[i + 1]]; the fit is the share of its points that found a surface. One
    prior_information `(3, 3)` about the start serves all.
    """
    n = starts.shape[0]
    poses = np.empty((n, 3))
    information = np.empty((n, 3, 3))
    fit = np.zeros(n)
    for k in prange(n):
        lo, hi = first_point[scans[k]], first_point[scans[k] + 1]
        pose, info, count = register(
            directory[maps[k]],
            pool,
            origin,
            resolution_m,
            points[lo:hi],
            normals[lo:hi],
            starts[k],
            starts[k],
            prior_information,
            sigma_m,
            reach_m,
            final_reach_m,
            iterations,
            least_used,
        )
        poses[k] = pose
        information[k] = info
        if hi > lo:
            fit[k] = count / (hi - lo)
    return poses, information, fit
