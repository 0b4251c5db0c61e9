"""Points of a scan by numpy, and their normals from the covariance of their neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.scan_matching import scan_points
from gridslam.kernels.scan_matching.prepared_points import PointDensity, PreparedPoints
from gridslam.kernels.scan_matching.scan_points import RangeLimits, Sweep

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def scan_to_points(
    ranges_m: NDArray[np.float32],
    angle_min_rad: float,
    angle_increment_rad: float,
    range_min_m: float,
    range_max_m: float,
    extrinsics: Floats,
) -> tuple[Floats, Ints]:
    """The usable beams of a scan taken at one moment: points `(m, 2)` in the robot's frame, and the beams' indices `(m,)`."""
    keep = np.flatnonzero((ranges_m > range_min_m) & (ranges_m < range_max_m))
    angles, r = angle_min_rad + angle_increment_rad * keep, ranges_m[keep].astype(np.float64)
    cos, sin = np.cos(extrinsics[2]), np.sin(extrinsics[2])
    x, y = r * np.cos(angles), r * np.sin(angles)
    return np.stack([extrinsics[0] + cos * x - sin * y, extrinsics[1] + sin * x + cos * y], axis=1), keep


def surface_normals(points: Floats, beams: Ints, viewpoint: Floats) -> Floats:
    """The eigenvector of the neighbours' covariance with the least eigenvalue, where they are a line; towards the viewpoint.

    Neighbours are followed to both sides while they lie within 2.5 times the distance to the nearer one (0.2 to 2.5 m), and no
    more than 12 beams away. A line is thinner than 4 cm, and its variance along is more than 1 / 0.15 of that across.
    """
    normals = np.zeros((len(points), 2))
    for i, point in enumerate(points):
        away = np.hypot(*(points - point).T)
        beside = [away[j] for j in (i - 1, i + 1) if 0 <= j < len(points)]
        radius = np.clip(2.5 * min([2.5, *beside]), 0.2, 2.5) if beside else 2.5
        near = (away < radius) & (np.abs(beams - beams[i]) <= 12)
        low = high = i
        while low > 0 and near[low - 1]:
            low -= 1
        while high < len(points) - 1 and near[high + 1]:
            high += 1
        patch = points[low : high + 1]
        if len(patch) < 3:
            continue
        (across, along), directions = np.linalg.eigh(np.cov(patch.T, ddof=0))
        across = max(across, 0.0)
        if along <= 0.0 or across > 0.15 * along or across > 0.04**2:
            continue
        normal = directions[:, 0]
        normals[i] = normal if normal @ (viewpoint - point) >= 0.0 else -normal
    return normals


def prepare_points(
    ranges_m: NDArray[np.float32],
    sweep: Sweep,
    limits: RangeLimits,
    extrinsics: Floats,
    twist: Floats,
    density: PointDensity,
) -> PreparedPoints:
    """The points of a scan step by step, each by the function that has its own test."""
    returns, beams = scan_points.scan_to_points(ranges_m, sweep, limits, extrinsics, twist)
    normals = scan_points.surface_normals(returns, beams, extrinsics[:2].copy())
    kept = scan_points.thin_out(returns, density.spacing_m, density.max_points)
    thin, thin_normals = returns[kept], normals[kept]
    chords = scan_points.surface_chords(thin, thin_normals, density.max_chord_m)
    filled = scan_points.fill_chords(thin, thin_normals, chords, density.chord_spacing_m)
    return PreparedPoints(returns, thin, thin_normals, *filled)
