"""Surface maps as dictionaries: cell (row, col) -> (count, mean point, mean normal)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Surfaces = dict[tuple[int, int], tuple[float, Floats, Floats]]

MAX_COUNT, REPLACEABLE, AGREEMENT = 50.0, 3.0, 0.6


def cell_of(point: Floats, resolution_m: float) -> tuple[int, int]:
    """(row, col)."""
    return math.floor(point[1] / resolution_m), math.floor(point[0] / resolution_m)


def insert(surfaces: Surfaces, points: Floats, normals: Floats, resolution_m: float) -> None:
    """Point by point: running means; a surface that faces the other way replaces a weak one."""
    for point, normal in zip(points, normals, strict=True):
        if not normal.any():
            continue
        cell = cell_of(point, resolution_m)
        count, mean, direction = surfaces.get(cell, (0.0, np.zeros(2), np.zeros(2)))
        if count > 0.0 and direction @ normal < 0.0:
            if count > REPLACEABLE:
                continue
            count = 0.0
        n = min(count + 1.0, MAX_COUNT)
        if n == 1.0:
            surfaces[cell] = (n, point, normal)
        else:
            surfaces[cell] = (n, mean + (point - mean) / n, direction + (normal - direction) / n)


def nearest(
    surfaces: Surfaces, point: Floats, normal: Floats, max_correspondence_m: float
) -> tuple[Floats, Floats] | None:
    """Mean point and normal of the nearest surface in max_correspondence that faces the same way."""
    found, best = None, max_correspondence_m
    for count, mean, direction in surfaces.values():
        distance = float(np.hypot(*(mean - point)))
        if count > 0.0 and distance < best and (not normal.any() or direction @ normal >= AGREEMENT):
            found, best = (mean, direction / np.hypot(*direction)), distance
    return found


def log_likelihood(
    surfaces: Surfaces,
    points: Floats,
    normals: Floats,
    sigma_m: float,
    max_correspondence_m: float,
    random_fraction: float,
) -> float:
    """With nothing known about free space: a point with no surface in max_correspondence counts as one at distance sigma."""
    total = 0.0
    for point, normal in zip(points, normals, strict=True):
        found = nearest(surfaces, point, normal, max_correspondence_m)
        e = sigma_m if found is None else float(found[1] @ (point - found[0]))
        total += math.log((1.0 - random_fraction) * math.exp(-0.5 * (e / sigma_m) ** 2) + random_fraction)
    return total


def placed(pose: Floats, points: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Points and normals of the robot's frame, seen from a pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    rotation = np.array([[c, -s], [s, c]])
    return points @ rotation.T + pose[:2], normals @ rotation.T


def register(
    surfaces: Surfaces,
    points: Floats,
    normals: Floats,
    start: Floats,
    prior_information: Floats,
    sigma_m: float,
    max_correspondence_m: float,
    final_correspondence_m: float,
    iterations: int,
) -> tuple[Floats, int]:
    """Gauss-Newton on the distances of points from the lines of their nearest surfaces; the prior's mean is the start.

    Weights after Geman and McClure; the max_correspondence is halved in every iteration.

    Returns the pose and the number of points used.
    """
    pose, max_correspondence, used = start.copy(), max_correspondence_m, 0
    for _ in range(iterations):
        rows, errors = [], []
        for point, normal in zip(*placed(pose, points, normals), strict=True):
            found = nearest(surfaces, point, normal, max_correspondence)
            if found is not None:
                mean, n = found
                arm = point - pose[:2]
                rows.append([n[0], n[1], n[1] * arm[0] - n[0] * arm[1]])
                errors.append(float(n @ (point - mean)))
        J, e, used = np.reshape(rows, (-1, 3)), np.array(errors), len(errors)
        weights = (1.0 + (e / sigma_m) ** 2) ** -2 / sigma_m**2
        hessian = J.T @ (weights[:, None] * J) + prior_information
        step = np.linalg.solve(hessian, -J.T @ (weights * e) - prior_information @ (pose - start))
        pose = pose + step
        if (
            np.abs(step[:2]).max() < 1e-4
            and abs(step[2]) < 1e-5
            and max_correspondence <= final_correspondence_m
        ):
            break
        max_correspondence = max(0.5 * max_correspondence, final_correspondence_m)
    return pose, used


def yaw_scores(
    surfaces: Surfaces,
    points: Floats,
    normals: Floats,
    pose: Floats,
    yaw_offsets: Floats,
    sigma_m: float,
    max_correspondence_m: float,
) -> list[float]:
    """How much of a scan lies on surfaces when the robot is turned by each of the angles."""
    scores = []
    for rotation in yaw_offsets:
        total = 0.0
        turned = np.array([pose[0], pose[1], pose[2] + rotation])
        for point, normal in zip(*placed(turned, points, normals), strict=True):
            found = nearest(surfaces, point, normal, max_correspondence_m)
            if found is not None:
                total += math.exp(-0.5 * float(((point - found[0]) ** 2).sum()) / sigma_m**2)
        scores.append(total)
    return scores
