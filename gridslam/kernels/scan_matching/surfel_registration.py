"""Point-to-line registration of scans in maps of surface elements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.grids.tiles import TileMap, TileMaps, map_of
from gridslam.kernels.scan_matching.surfels import NX, NY, OrientedPoints, X, Y, nearest_surfel
from gridslam.kernels.threads import run_in_ranges

# A step below both is the last: 0.1 mm, and a rotation that moves a point at 10 m by 0.1 mm; lidars measure to centimetres.
CONVERGED_M = 1e-4
CONVERGED_RAD = 1e-5


class Registration(NamedTuple):
    """Scale of the robust loss, farthest correspondence in the first and in the last iterations, when to stop.

    With fewer than `min_correspondences` the registration stops early.
    """

    sigma_m: float
    max_correspondence_m: float
    final_correspondence_m: float
    max_iterations: int
    min_correspondences: float


class PosePrior(NamedTuple):
    """A Gaussian prior: the pose (3,) and its information `(3, 3)`."""

    pose: NDArray[np.float64]
    information: NDArray[np.float64]


class PosePriors(NamedTuple):
    """Gaussian priors of many poses: `(n, 3)` and `(n, 3, 3)`."""

    poses: NDArray[np.float64]
    information: NDArray[np.float64]


class YawSearch(NamedTuple):
    """Headings `step_rad` apart, `steps` of them to each side, and the likelihood field that scores them.

    At most `max_points` of a scan are scored.
    """

    step_rad: float
    steps: int
    max_points: int
    sigma_m: float
    max_correspondence_m: float


@compiled
def _normal_equations(
    surfaces: TileMap,
    scan: OrientedPoints,
    pose: NDArray[np.float64],
    sigma_m: float,
    max_correspondence_m: float,
    information: NDArray[np.float64],
) -> tuple[NDArray[np.float64], int]:
    """The scan's part of a Gauss-Newton step: fills `information` `(3, 3)`; returns gradient (3,) and correspondences."""
    points, normals, pool = scan.points, scan.normals, surfaces.pool
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
        tile, row, col = nearest_surfel(surfaces, x, y, nx=nx, ny=ny, max_distance_m=max_correspondence_m)
        if tile < 0:
            continue
        mean_nx, mean_ny = pool[tile, row, col, NX], pool[tile, row, col, NY]
        scale = 1.0 / np.sqrt(mean_nx * mean_nx + mean_ny * mean_ny)
        mx, my = mean_nx * scale, mean_ny * scale
        e = mx * (x - pool[tile, row, col, X]) + my * (y - pool[tile, row, col, Y])
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
def solve_symmetric(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """The solution (3,) of a positive definite system `(3, 3)`, by its factors L D L'."""
    d0 = matrix[0, 0]
    l10, l20 = matrix[1, 0] / d0, matrix[2, 0] / d0
    d1 = matrix[1, 1] - l10 * l10 * d0
    l21 = (matrix[2, 1] - l20 * l10 * d0) / d1
    d2 = matrix[2, 2] - l20 * l20 * d0 - l21 * l21 * d1
    y1 = right[1] - l10 * right[0]
    z = (right[2] - l20 * right[0] - l21 * y1) / d2
    y = y1 / d1 - l21 * z
    return np.array([right[0] / d0 - l10 * y - l20 * z, y, z])


@compiled
def register(
    surfaces: TileMap,
    scan: OrientedPoints,
    start: NDArray[np.float64],
    prior: PosePrior,
    settings: Registration,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Robust Gauss-Newton on the point-to-line distances to one map, with a Gaussian prior on the pose.

    Minimises sum rho(n_k . (T p_i - q_k)) + (T - prior)' information (T - prior) from `start` (3,), with the Geman-McClure
    loss rho of scale `sigma_m`. The farthest correspondence is halved every iteration down to `final_correspondence_m`.

    Returns the pose (3,), the information of the scan alone at it `(3, 3)`, and the number of correspondences.
    """
    pose = start.copy()
    scan_information = np.zeros((3, 3))
    used = 0
    max_correspondence_m = settings.max_correspondence_m
    for _ in range(settings.max_iterations):
        scan_gradient, used = _normal_equations(
            surfaces,
            scan,
            pose,
            sigma_m=settings.sigma_m,
            max_correspondence_m=max_correspondence_m,
            information=scan_information,
        )
        offset = pose - prior.pose
        offset[2] -= 2.0 * np.pi * np.round(offset[2] / (2.0 * np.pi))
        gradient = scan_gradient + prior.information @ offset
        step = solve_symmetric(scan_information + prior.information, -gradient)
        pose += step
        if used < settings.min_correspondences:
            break
        converged = abs(step[0]) < CONVERGED_M and abs(step[1]) < CONVERGED_M and abs(step[2]) < CONVERGED_RAD
        if converged and max_correspondence_m <= settings.final_correspondence_m:
            break
        max_correspondence_m = max(0.5 * max_correspondence_m, settings.final_correspondence_m)
    return pose, scan_information, used


@compiled
def search_yaw(
    surfaces: TileMap, scan: OrientedPoints, predicted: NDArray[np.float64], search: YawSearch
) -> NDArray[np.float64]:
    """The predicted pose (3,) with the heading offset, a multiple of the step, under which most points lie on surfaces.

    A point at distance d from the nearest surface element scores exp(-d^2 / (2 sigma^2)). Of equal scores the smallest
    offset wins.
    """
    points, normals, pool = scan.points, scan.normals, surfaces.pool
    best_score = -1.0
    best_yaw = predicted[2]
    for k in range(2 * search.steps + 1):
        offset = ((k + 1) // 2) * search.step_rad * (1.0 if k % 2 else -1.0)
        yaw = predicted[2] + offset
        c, s = np.cos(yaw), np.sin(yaw)
        score = 0.0
        for i in range(points.shape[0]):
            if score + (points.shape[0] - i) <= best_score:
                break  # a point adds at most 1
            x = predicted[0] + c * points[i, 0] - s * points[i, 1]
            y = predicted[1] + s * points[i, 0] + c * points[i, 1]
            nx = c * normals[i, 0] - s * normals[i, 1]
            ny = s * normals[i, 0] + c * normals[i, 1]
            tile, row, col = nearest_surfel(
                surfaces, x, y, nx=nx, ny=ny, max_distance_m=search.max_correspondence_m
            )
            if tile >= 0:
                d2 = (x - pool[tile, row, col, X]) ** 2 + (y - pool[tile, row, col, Y]) ** 2
                score += np.exp(-0.5 * d2 / (search.sigma_m * search.sigma_m))
        if score > best_score:
            best_score = score
            best_yaw = yaw
    return np.array([predicted[0], predicted[1], best_yaw])


@compiled
def match_scan(
    surfaces: TileMap,
    scan: OrientedPoints,
    prior: PosePrior,
    search: YawSearch,
    settings: Registration,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """The scan registered from the prior's pose, or from its best heading within the search's steps.

    Returns the pose (3,), the information of the scan alone at it `(3, 3)`, and the number of correspondences.
    """
    start = prior.pose
    if search.steps > 0:
        start = search_yaw(surfaces, even_sample(scan, search.max_points), start, search)
    pose, information, used = register(surfaces, scan, start, prior, settings)
    return pose, information, used


@compiled
def even_sample(scan: OrientedPoints, max_points: int) -> OrientedPoints:
    """At most `max_points` of the points, distributed evenly over the scan."""
    m = scan.points.shape[0]
    if m <= max_points:
        return scan
    points, normals = np.empty((max_points, 2)), np.empty((max_points, 2))
    for i in range(max_points):
        copy_row(points, i, scan.points[i * m // max_points])
        copy_row(normals, i, scan.normals[i * m // max_points])
    return OrientedPoints(points, normals)


def register_all(
    maps: TileMaps,
    scan: OrientedPoints,
    starts: NDArray[np.float64],
    priors: PosePriors,
    settings: Registration,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """`register` for every particle from its start `(n, 3)` in its own map, with a prior each.

    Returns poses `(n, 3)`, information `(n, 3, 3)`, and the numbers of correspondences `(n,)`.
    """
    n = starts.shape[0]
    poses = np.empty((n, 3))
    information = np.empty((n, 3, 3))
    used = np.empty(n, np.int64)
    run_in_ranges(_register_all, n, (maps, scan, starts, priors, settings, poses, information, used))
    return poses, information, used


@compiled
def _register_all(
    first: int,
    last: int,
    maps: TileMaps,
    scan: OrientedPoints,
    starts: NDArray[np.float64],
    priors: PosePriors,
    settings: Registration,
    poses: NDArray[np.float64],
    information: NDArray[np.float64],
    used: NDArray[np.int64],
) -> None:
    """Fill in the items first to last - 1 of `register_all`."""
    for k in range(first, last):
        prior = PosePrior(priors.poses[k], priors.information[k])
        pose, info, count = register(map_of(maps, k), scan, starts[k], prior, settings)
        copy_row(poses, k, pose)
        for row in range(3):
            copy_row(information[k], row, info[row])
        used[k] = count
