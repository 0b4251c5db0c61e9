"""Which end points belong to tagged objects: they do not enter the static map (METHODS 3.2, step 5)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.scans import PreparedScan
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
    out = np.zeros(len(points), np.bool_)
    for corners in outlines:
        low, high = corners.min(axis=0) - reach_m, corners.max(axis=0) + reach_m
        near = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
        if len(near):
            out[near] |= _on_one(points[near], corners, reach_m)
    return out


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


def _on_one(points: Floats, corners: Floats, reach_m: float) -> Bools:
    start, end = corners, np.roll(corners, -1, axis=0)
    edge = end - start
    way = points[:, None, :] - start
    share = np.clip((way * edge).sum(axis=2) / np.maximum((edge**2).sum(axis=1), 1e-12), 0.0, 1.0)
    distance = np.hypot(*np.moveaxis(way - share[..., None] * edge, 2, 0)).min(axis=1)
    crosses = (start[:, 1] > points[:, 1, None]) != (end[:, 1] > points[:, 1, None])
    rise = np.where(edge[:, 1] == 0.0, 1.0, edge[:, 1])
    left = points[:, 0, None] < start[:, 0] + (points[:, 1, None] - start[:, 1]) * edge[:, 0] / rise
    inside = (crosses & left).sum(axis=1) % 2 == 1
    return np.asarray(inside | (distance <= reach_m))
