"""A map as one submap, in which parts of a drive are searched for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.kernels.scan_matching.submap_matching import SubmapMatches, SubmapPairs, match_submaps
from gridslam.kernels.scan_matching.window_search import WindowSearch
from gridslam.lidar_slam.loop_closure import search
from gridslam.lidar_slam.loop_closure.segments import CLOUD_CELL_M

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BEAM_CELL_M = 1.5  # cell of the segments' references in which the beams of the last segment are kept
DRAWING = search.DRAWING._replace(max_points=200)  # enough in a window as large as the map, which costs time


@dataclass(frozen=True, slots=True)
class KnownMap:
    """The segments of a map: their poses `(s, 3)`, clouds, and the edges that hold them."""

    poses: Floats
    clouds: SegmentClouds
    edges: Edges


@dataclass(frozen=True, slots=True)
class WholeMap:
    """Points with their normals `(p, 2)` and beams `(b, 4)` of all segments of a map, in its frame."""

    points: Floats
    normals: Floats
    beams: Floats


def whole_map(known: KnownMap) -> WholeMap:
    """Points and beams of all segments in the map frame; where several segments cover a cell, those of the last one."""
    clouds, poses = known.clouds, known.poses
    segment = np.repeat(np.arange(len(poses)), np.diff(clouds.first_point))
    c, s = np.cos(poses[segment, 2]), np.sin(poses[segment, 2])
    points = np.stack(
        [
            poses[segment, 0] + c * clouds.points[:, 0] - s * clouds.points[:, 1],
            poses[segment, 1] + s * clouds.points[:, 0] + c * clouds.points[:, 1],
        ],
        axis=1,
    )
    nx, ny = clouds.normals.T
    normals = np.stack([c * nx - s * ny, s * nx + c * ny], axis=1)
    kept = _last_in_cells(points, CLOUD_CELL_M)
    chosen = _last_in_cells(poses[:, :2], BEAM_CELL_M)
    beams = [np.zeros((0, 4))]
    for k in chosen.tolist():
        own = clouds.beams[clouds.first_beam[k] : clouds.first_beam[k + 1]]
        ends = se2.transform_points(poses[k], own.reshape(-1, 2))
        beams.append(ends.reshape(-1, 4))
    return WholeMap(points[kept], normals[kept], np.concatenate(beams))


def _last_in_cells(points: Floats, cell_m: float) -> Ints:
    """Rows, in order, of the last of the points `(n, 2)` in every cell."""
    cells = np.floor(points / cell_m).astype(np.int64)
    _, first = np.unique(cells[::-1], axis=0, return_index=True)
    return np.sort(len(points) - 1 - first)


def match_in(
    union: WholeMap, drive: KnownMap, queries: Ints, *, how: WindowSearch, starts: Floats, window: Floats
) -> SubmapMatches:
    """Each query with its neighbours against the map, in a window `(3,)` around its start `(q, 3)`."""
    pairs = _pairs(drive.poses, queries, starts, window)
    return match_submaps(_with_map(drive.clouds, union), pairs, DRAWING, how, search.REGISTRATION)


def _pairs(poses: Floats, queries: Ints, starts: Floats, window: Floats) -> SubmapPairs:
    """Each query with its neighbours against the map, which is the last segment."""
    n, count = len(poses), len(queries)
    first = np.maximum(queries - search.QUERY_SEGMENTS, 0)
    last = np.minimum(queries + search.QUERY_SEGMENTS, n - 1)
    members = [se2.between(poses[q], poses[a : b + 1]) for q, a, b in zip(queries, first, last, strict=True)]
    whole = np.full(count, n, np.int64)
    return SubmapPairs(
        target_first=whole,
        target_last=whole,
        target_row=np.arange(count + 1, dtype=np.int64),
        target_poses=np.zeros((count, 3)),
        query_first=first,
        query_last=last,
        query_row=offsets_of((last - first + 1).tolist()),
        query_poses=np.concatenate(members),
        starts=starts,
        windows=np.tile(window, (count, 1)),
    )


def _with_map(clouds: SegmentClouds, union: WholeMap) -> SegmentClouds:
    """The clouds of the drive, and the map as one more segment."""
    return SegmentClouds(
        np.concatenate([clouds.points, union.points]),
        np.concatenate([clouds.normals, union.normals]),
        np.append(clouds.first_point, len(clouds.points) + len(union.points)),
        np.concatenate([clouds.beams, union.beams]),
        np.append(clouds.first_beam, len(clouds.beams) + len(union.beams)),
    )
