"""Submaps: the surfaces of a few consecutive key scans, in the frame of their middle one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import correlative_matching, surfels
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.distances import distances_to
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]
PYRAMID_LEVELS = 5


@dataclass(frozen=True, slots=True)
class Span:
    """Key scans first..last (inclusive) and the one in the middle, whose frame is the submap's."""

    first: int
    last: int

    @property
    def centre(self) -> int:
        """The key scan that carries the submap."""
        return (self.first + self.last) // 2


@dataclass(frozen=True, slots=True)
class LikelihoodPyramid:
    """`levels` uint8 `(levels, rows, cols)`, 255 on a surface, with the lower-left corner and the cell's size."""

    levels: NDArray[np.uint8]
    origin_xy_m: Floats
    resolution_m: float


def spans_of(n_keys: int, length: int) -> list[Span]:
    """Spans of `length` key scans, each sharing half of them with the next; the last ends with the last key scan."""
    if n_keys <= length:
        return [Span(0, n_keys - 1)]
    starts = list(range(0, n_keys - length, max(length // 2, 1)))
    return [Span(s, s + length - 1) for s in starts] + [Span(n_keys - length, n_keys - 1)]


def build_submaps(
    spans: Sequence[Span],
    scans: Sequence[PreparedScan],
    poses: Floats,
    resolution_m: float,
    memory_limit_mb: float,
) -> TileStore:
    """Map k holds the surfaces of span k, drawn from the poses `(n, 3)` of the key scans."""
    store = TileStore(len(spans), surfels.CHANNELS, resolution_m, memory_limit_mb)
    for index, span in enumerate(spans):
        local = se2.between(poses[span.centre], poses[span.first : span.last + 1])
        for pose, scan in zip(local, scans[span.first : span.last + 1], strict=True):
            store.own_end_points(np.array([index]), pose[None], scan.surface)
            surfels.insert_surfels(
                store.directory[index],
                store.pool,
                store.origin,
                resolution_m,
                pose,
                scan.surface,
                scan.surface_normals,
            )
    return store


def likelihood_pyramid(
    scans: Sequence[PreparedScan], local_poses: Floats, resolution_m: float, sigma_m: float, reach_m: float
) -> LikelihoodPyramid:
    """The likelihood field exp(-d^2 / (2 sigma^2)) of the scans' surfaces seen from local poses, within reach of the frame."""
    margin = 2**PYRAMID_LEVELS
    half = int(np.ceil(reach_m / resolution_m)) + margin
    occupied = np.zeros((2 * half, 2 * half), np.bool_)
    for pose, scan in zip(local_poses, scans, strict=True):
        cells = np.floor(se2.transform_points(pose, scan.surface) / resolution_m).astype(np.int64) + half
        inside = ((cells >= margin) & (cells < 2 * half - margin)).all(axis=1)
        occupied[cells[inside, 1], cells[inside, 0]] = True
    distance = resolution_m * distances_to(occupied)
    field = np.rint(255.0 * np.exp(-0.5 * (distance / sigma_m) ** 2)).astype(np.uint8)
    corner = np.array([-half * resolution_m, -half * resolution_m])
    return LikelihoodPyramid(correlative_matching.field_pyramid(field, PYRAMID_LEVELS), corner, resolution_m)
