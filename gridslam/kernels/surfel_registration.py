"""Point-to-line registration of scans in maps of surface elements."""

from __future__ import annotations

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled, compiled_parallel
from gridslam.kernels.surfels import NX, NY, X, Y, nearest_surfel

CONVERGED_M = 1e-4
CONVERGED_RAD = 1e-5


@compiled
def _normal_equations(
    directory: NDArray[np.int32],
    pool: NDArray[np.float32],
    origin: NDArray[np.int64],
    resolution_m: float,
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    pose: NDArray[np.float64],
    sigma_m: float,
    reach_m: float,
    information: NDArray[np.float64],
) -> tuple[NDArray[np.float64], int]:
    """The scan's part of a Gauss-Newton step: fills `information` `(3, 3)`; returns the gradient `(3,)`, points that count."""
    information[:] = 0.0
    g0 = g1 = g2 = 0.0
    c, s = np.cos(pose[2]), np.sin(pose[2])
    used = 0
    for i in range(points.shape[0]):
        rx = c * points[i, 0] - s * points[i, 1]
        ry = s * points[i, 0] + c * points[i, 1]
        nx = c * normals[i, 0] - s * normals[i, 1]
        ny = s * normals[i, 0] + c * normals[i, 1]
        x, y = pose[0] + rx, pose[1] + ry
        tile, row, col = nearest_surfel(directory, pool, origin, resolution_m, x, y, nx, ny, reach_m)
        if tile < 0:
            continue
        cell = pool[tile, row, col]
        scale = 1.0 / np.sqrt(cell[NX] * cell[NX] + cell[NY] * cell[NY])
        mx, my = cell[NX] * scale, cell[NY] * scale
        e = mx * (x - cell[X]) + my * (y - cell[Y])
        w = 1.0 / (1.0 + (e / sigma_m) ** 2)
        w = w * w / (sigma_m * sigma_m)
        j = my * rx - mx * ry
        information[0, 0] += w * mx * mx
        information[0, 1] += w * mx * my
        information[0, 2] += w * mx * j
        information[1, 1] += w * my * my
        information[1, 2] += w * my * j
        information[2, 2] += w * j * j
        g0 += w * mx * e
        g1 += w * my * e
        g2 += w * j * e
        used += 1
    information[1, 0] = information[0, 1]
    information[2, 0] = information[0, 2]
    information[2, 1] = information[1, 2]
    return np.array([g0, g1, g2]), used


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
        scan_gradient, used = _normal_equations(
            directory, pool, origin, resolution_m, points, normals, pose, sigma_m, reach, scan_information
        )
        off = pose - prior
        off[2] -= 2.0 * np.pi * np.round(off[2] / (2.0 * np.pi))
        gradient = scan_gradient + prior_information @ off
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
            tile, row, col = nearest_surfel(directory, pool, origin, resolution_m, x, y, nx, ny, reach_m)
            if tile >= 0:
                cell = pool[tile, row, col]
                d2 = (x - cell[X]) ** 2 + (y - cell[Y]) ** 2
                score += np.exp(-0.5 * d2 / (sigma_m * sigma_m))
        if score > best_score:
            best_score = score
            best_yaw = yaw
    return np.array([predicted[0], predicted[1], best_yaw])


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
