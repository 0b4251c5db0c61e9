"""Endpoints that belong to tagged objects: they do not enter the static map."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import object_weights
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.objects.object_history import ObjectHistory

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def footprints_at_key_scan(
    key: int, stamp_ns: int, path: Floats, objects: Iterable[ObjectHistory]
) -> list[Floats]:
    """Corners `(k, 2)` of the objects where they may have stood at a key scan, in the robot's frame at that scan."""
    return [
        found.model.corners_at(se2.between(path[key], episode.pose_in_map(path)))
        for found in objects
        for episode in found.at(stamp_ns)
    ]


def points_on(points: Floats, footprints: Sequence[Floats], margin_m: float) -> Bools:
    """Mask `(m,)` of the points `(m, 2)` inside a footprint `(k, 2)`, or at most `margin_m` outside of it."""
    marked = np.zeros(len(points), np.bool_)
    for corners in footprints:
        object_weights.mark_points_on(points, corners, margin_m, marked)
    return marked


def without_points_on(scan: PreparedScan, footprints: Sequence[Floats], margin_m: float) -> PreparedScan:
    """The scan without the points on these footprints `(k, 2)` in the robot's frame; its returns are kept."""
    kept = ~points_on(scan.points, footprints, margin_m)
    surface = ~points_on(scan.surface, footprints, margin_m)
    if kept.all() and surface.all():
        return scan
    return replace(
        scan,
        points=np.ascontiguousarray(scan.points[kept]),
        normals=np.ascontiguousarray(scan.normals[kept]),
        surface=np.ascontiguousarray(scan.surface[surface]),
        surface_normals=np.ascontiguousarray(scan.surface_normals[surface]),
    )
