"""Which end points belong to tagged objects: they do not enter the static map."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import object_weights
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.stays import TrackedObject

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def outlines_seen_from(
    key: int, stamp_ns: int, path: Floats, objects: Iterable[TrackedObject]
) -> list[Floats]:
    """The corners `(k, 2)` of the objects where they may have stood at a key scan, in the robot's frame then."""
    return [
        found.thing.placed(se2.between(path[key], stay.placed(path)))
        for found in objects
        for stay in found.at(stamp_ns)
    ]


def points_on(points: Floats, outlines: Sequence[Floats], reach_m: float) -> Bools:
    """Which points `(m, 2)` lie within an outline or no farther than `reach_m` from its edges."""
    marked = np.zeros(len(points), np.bool_)
    for corners in outlines:
        object_weights.mark_points_on(points, corners, reach_m, marked)
    return marked


def without_objects(scan: PreparedScan, outlines: Sequence[Floats], reach_m: float) -> PreparedScan:
    """The scan without the end points on these outlines `(k, 2)`, which are in the robot's frame."""
    kept = ~points_on(scan.points, outlines, reach_m)
    surface = ~points_on(scan.surface, outlines, reach_m)
    if kept.all() and surface.all():
        return scan
    return replace(
        scan,
        points=np.ascontiguousarray(scan.points[kept]),
        normals=np.ascontiguousarray(scan.normals[kept]),
        surface=np.ascontiguousarray(scan.surface[surface]),
        surface_normals=np.ascontiguousarray(scan.surface_normals[surface]),
    )
