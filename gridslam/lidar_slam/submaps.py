"""Submaps: the surfaces of consecutive key scans, in the frame of their middle one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import surfels
from gridslam.kernels.correlative_matching import FieldPyramid, field_pyramid
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.distances import distances_to
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]

PYRAMID_LEVELS = 5
FIELD_SIGMA_M = 0.1  # of the likelihood field of a submap: about one cell of it
FIELD_RADIUS_M = 30.0  # half width of the field: scans are matched by what lies within it


@dataclass(frozen=True, slots=True)
class SubmapSpan:
    """Key scans first..last (inclusive); the submap is in the frame of the middle one."""

    first: int
    last: int

    @property
    def centre(self) -> int:
        """Index of the key scan whose frame is the submap's."""
        return (self.first + self.last) // 2


def submap_spans(n_keys: int, length: int) -> list[SubmapSpan]:
    """Spans of `length` key scans; each shares half of them with the next, and the last one ends with the last key scan."""
    if n_keys <= length:
        return [SubmapSpan(0, n_keys - 1)]
    starts = list(range(0, n_keys - length, max(length // 2, 1)))
    return [SubmapSpan(s, s + length - 1) for s in starts] + [SubmapSpan(n_keys - length, n_keys - 1)]


def build_submaps(
    spans: Sequence[SubmapSpan],
    scans: Sequence[PreparedScan],
    poses: Floats,
    resolution_m: float,
    memory_limit_mb: float,
) -> TileStore:
    """One surface map per span, drawn from the poses `(n, 3)` of the key scans `(n)`.

    Raises MethodError if the maps would exceed the memory limit.
    """
    store = TileStore(len(spans), surfels.CHANNELS, resolution_m, memory_limit_mb)
    for index, span in enumerate(spans):
        local = se2.between(poses[span.centre], poses[span.first : span.last + 1])
        for pose, scan in zip(local, scans[span.first : span.last + 1], strict=True):
            store.own_endpoints(np.array([index]), pose[None], scan.surface)
            surfels.insert_surfels(store.map(index), pose, scan.surfaces)
    return store


def likelihood_pyramid(
    scans: Sequence[PreparedScan], local_poses: Floats, resolution_m: float
) -> FieldPyramid:
    """Pyramid of the likelihood field exp(-d^2 / (2 sigma^2)) of the scans' surfaces, seen from local poses `(n, 3)`.

    Values are 0 to 255 on a surface. Surfaces farther than `FIELD_RADIUS_M` from the submap's origin are left out.
    """
    margin = 2**PYRAMID_LEVELS
    half = int(np.ceil(FIELD_RADIUS_M / resolution_m)) + margin
    occupied = np.zeros((2 * half, 2 * half), np.bool_)
    for pose, scan in zip(local_poses, scans, strict=True):
        cells = np.floor(se2.transform_points(pose, scan.surface) / resolution_m).astype(np.int64) + half
        inside = ((cells >= margin) & (cells < 2 * half - margin)).all(axis=1)
        occupied[cells[inside, 1], cells[inside, 0]] = True
    distance = resolution_m * distances_to(occupied)
    field = np.rint(255.0 * np.exp(-0.5 * (distance / FIELD_SIGMA_M) ** 2)).astype(np.uint8)
    corner = np.array([-half * resolution_m, -half * resolution_m])
    return FieldPyramid(field_pyramid(field, PYRAMID_LEVELS), corner, resolution_m)
