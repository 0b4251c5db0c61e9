"""Point clouds of a trajectory's segments, and submaps put together from them.

A segment is a short stretch of the trajectory; a submap is a run of segments whose poses relative to each other are known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.tiles import TILE_BITS, TILE_CELLS, ScanSet, TileMap
from gridslam.kernels.scan_matching.surfel_registration import PosePrior
from gridslam.kernels.scan_matching.surfels import CHANNELS, OrientedPoints, insert_surfels

# Standard deviations of a registration along a direction that the points leave open
OPEN_STD_M, OPEN_STD_RAD = 0.3, 0.05
MAX_LEVERAGE = 4.0  # times the mean: no single point decides a match
# Fraction of the normals that counts as pointing everywhere, so that leverage stays finite
MIN_NORMAL_FRACTION = 0.02
HASH_FACTOR = np.int64(0x9E3779B97F4A7C15 - (1 << 64))  # 2^64 divided by the golden ratio


class SegmentClouds(NamedTuple):
    """Points and beams of segments, each in the frame of its reference pose.

    Segment i owns `points` `(n, 2)` and their `normals` `(n, 2)` from first_point[i] to first_point[i + 1], and `beams`
    `(m, 4)` from (x, y) to (x, y) from first_beam[i] to first_beam[i + 1].
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    first_point: NDArray[np.int64]
    beams: NDArray[np.float64]
    first_beam: NDArray[np.int64]


@compiled
def segment_cloud(
    surfaces: ScanSet,
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    cell_m: float,
    max_range_m: float,
) -> OrientedPoints:
    """The first point in each cell of the surfaces, seen from `poses` `(s, 3)`, within the range of `viewpoints` `(s, 2)`."""
    n = surfaces.points.shape[0]
    points, normals = np.empty((n, 2)), np.empty((n, 2))
    slots = 16
    while slots < 2 * n:
        slots *= 2
    keys = np.full(slots, np.iinfo(np.int64).min)
    count = 0
    for i in range(poses.shape[0]):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        viewpoint = viewpoints[i]
        for k in range(surfaces.first_point[i], surfaces.first_point[i + 1]):
            px, py = surfaces.points[k, 0], surfaces.points[k, 1]
            if (px - viewpoint[0]) ** 2 + (py - viewpoint[1]) ** 2 > max_range_m * max_range_m:
                continue
            x = poses[i, 0] + c * px - s * py
            y = poses[i, 1] + s * px + c * py
            key = (int(np.floor(x / cell_m)) << 32) + int(np.floor(y / cell_m))
            slot = ((key * HASH_FACTOR) >> 20) & (slots - 1)
            while keys[slot] != np.iinfo(np.int64).min and keys[slot] != key:
                slot = (slot + 1) & (slots - 1)
            if keys[slot] == key:
                continue
            keys[slot] = key
            nx, ny = surfaces.normals[k, 0], surfaces.normals[k, 1]
            points[count, 0], points[count, 1] = x, y
            normals[count, 0], normals[count, 1] = c * nx - s * ny, s * nx + c * ny
            count += 1
    return OrientedPoints(points[:count].copy(), normals[:count].copy())


@compiled
def segment_beams(
    endpoints: NDArray[np.float64],
    first_endpoint: NDArray[np.int64],
    poses: NDArray[np.float64],
    viewpoints: NDArray[np.float64],
    step: int,
    max_range_m: float,
) -> NDArray[np.float64]:
    """Every `step`-th beam `(m, 4)` of scans at `poses` `(n, 3)`: origin x, y and endpoint x, y (m), cut at `max_range_m`.

    Scan i owns endpoints[first_endpoint[i]:first_endpoint[i + 1]] `(e, 2)`, in its robot's frame as `viewpoints` `(n, 2)` are.
    """
    beams = np.empty((endpoints.shape[0] // step + poses.shape[0], 4))
    count = 0
    for i in range(poses.shape[0]):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        viewpoint = viewpoints[i]
        for k in range(first_endpoint[i], first_endpoint[i + 1], step):
            dx, dy = endpoints[k, 0] - viewpoint[0], endpoints[k, 1] - viewpoint[1]
            kept = min(max_range_m / max(np.sqrt(dx * dx + dy * dy), 1e-9), 1.0)
            ex, ey = viewpoint[0] + kept * dx, viewpoint[1] + kept * dy
            beams[count, 0] = poses[i, 0] + c * viewpoint[0] - s * viewpoint[1]
            beams[count, 1] = poses[i, 1] + s * viewpoint[0] + c * viewpoint[1]
            beams[count, 2] = poses[i, 0] + c * ex - s * ey
            beams[count, 3] = poses[i, 1] + s * ex + c * ey
            count += 1
    return beams[:count].copy()


@compiled
def submap_points(clouds: SegmentClouds, first: int, last: int, poses: NDArray[np.float64]) -> OrientedPoints:
    """The points of the segments first..last, at `poses` `(last - first + 1, 3)` in the submap's frame."""
    n = clouds.first_point[last + 1] - clouds.first_point[first]
    points, normals = np.empty((n, 2)), np.empty((n, 2))
    k = 0
    for segment in range(first, last + 1):
        pose = poses[segment - first]
        c, s = np.cos(pose[2]), np.sin(pose[2])
        for i in range(clouds.first_point[segment], clouds.first_point[segment + 1]):
            px, py = clouds.points[i, 0], clouds.points[i, 1]
            nx, ny = clouds.normals[i, 0], clouds.normals[i, 1]
            points[k, 0] = pose[0] + c * px - s * py
            points[k, 1] = pose[1] + s * px + c * py
            normals[k, 0] = c * nx - s * ny
            normals[k, 1] = s * nx + c * ny
            k += 1
    return OrientedPoints(points, normals)


@compiled
def leverage_sample(cloud: OrientedPoints, max_points: int) -> OrientedPoints:
    """`max_points` of the points, those that fix the pose's weakest direction more often than others.

    A point's weight is its leverage n' (sum n n')^-1 n: along a corridor the few door frames weigh as much together as the
    two walls. The weights are capped. The sample is systematic: it is the same every time, and may hold a point twice.
    """
    normals = cloud.normals
    n = normals.shape[0]
    xx = xy = yy = 0.0
    for i in range(n):
        xx += normals[i, 0] * normals[i, 0]
        xy += normals[i, 0] * normals[i, 1]
        yy += normals[i, 1] * normals[i, 1]
    isotropic = MIN_NORMAL_FRACTION * (xx + yy) + 1e-9
    xx += isotropic
    yy += isotropic
    det = xx * yy - xy * xy
    weights = np.empty(n)
    mean = 2.0 / max(n, 1)  # leverages add up to the two dimensions
    for i in range(n):
        nx, ny = normals[i, 0], normals[i, 1]
        leverage = (yy * nx * nx - 2.0 * xy * nx * ny + xx * ny * ny) / det
        weights[i] = min(leverage, MAX_LEVERAGE * mean) if nx != 0.0 or ny != 0.0 else 0.5 * mean
    step = weights.sum() / max_points
    chosen = np.full(max_points, n - 1)
    reached, k = 0.0, 0
    for i in range(n):
        reached += weights[i]
        while k < max_points and (k + 0.5) * step <= reached:
            chosen[k] = i
            k += 1
    return OrientedPoints(cloud.points[chosen], normals[chosen])


@compiled
def surfel_map(cloud: OrientedPoints, cell_m: float) -> TileMap:
    """A map of the surface elements of at least one point."""
    points = cloud.points
    tile_m = cell_m * TILE_CELLS
    origin = np.empty(2, np.int64)
    origin[0] = int(np.floor(points[:, 1].min() / tile_m))
    origin[1] = int(np.floor(points[:, 0].min() / tile_m))
    rows = int(np.floor(points[:, 1].max() / tile_m)) - origin[0] + 1
    cols = int(np.floor(points[:, 0].max() / tile_m)) - origin[1] + 1
    directory = np.full((rows, cols), -1, np.int32)
    used = 0
    for i in range(points.shape[0]):
        row = (int(np.floor(points[i, 1] / cell_m)) >> TILE_BITS) - origin[0]
        col = (int(np.floor(points[i, 0] / cell_m)) >> TILE_BITS) - origin[1]
        if directory[row, col] < 0:
            directory[row, col] = used
            used += 1
    pool = np.zeros((used, TILE_CELLS, TILE_CELLS, CHANNELS), np.float32)
    surfels = TileMap(directory, pool, origin, cell_m)
    insert_surfels(surfels, np.zeros(3), cloud)
    return surfels


@compiled
def weak_prior(pose: NDArray[np.float64]) -> PosePrior:
    """A prior that keeps a registration near `pose` (3,) along a direction that the points leave open."""
    information = np.zeros((3, 3))
    information[0, 0] = information[1, 1] = 1.0 / OPEN_STD_M**2
    information[2, 2] = 1.0 / OPEN_STD_RAD**2
    return PosePrior(pose, information)
