"""Registration of segments in submaps, many at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import prange
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled_parallel
from gridslam.kernels.segment_clouds import SegmentClouds, submap_points, surfel_map, weak_prior
from gridslam.kernels.surfel_registration import Registration, register
from gridslam.kernels.surfels import OrientedPoints


class SegmentPairs(NamedTuple):
    """Segment queries[p] is to be registered from the pose starts[p] `(p, 3)`, in the submap that owns p."""

    queries: NDArray[np.int64]
    starts: NDArray[np.float64]


class SubmapMembers(NamedTuple):
    """Submap k is the segments first[k]..last[k] at `poses` `(., 3)` from row[k] in its frame.

    It owns the pairs first_pair[k]..first_pair[k + 1].
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    row: NDArray[np.int64]
    poses: NDArray[np.float64]
    first_pair: NDArray[np.int64]


@compiled_parallel
def register_segments(
    clouds: SegmentClouds,
    submaps: SubmapMembers,
    pairs: SegmentPairs,
    max_points: int,
    surfel_cell_m: float,
    registration: Registration,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Register segments in submaps: poses `(p, 3)`, information `(p, 3, 3)`, inlier ratios `(p,)`.

    At most about `max_points` of a segment are used; the information is scaled to all of its points.
    """
    n = pairs.starts.shape[0]
    poses, information, ratio = pairs.starts.copy(), np.zeros((n, 3, 3)), np.zeros(n)
    for k in prange(submaps.first.shape[0]):
        if submaps.first_pair[k] == submaps.first_pair[k + 1]:
            continue
        at = submaps.poses[submaps.row[k] : submaps.row[k + 1]]
        target = submap_points(clouds, submaps.first[k], submaps.last[k], at)
        if target.points.shape[0] == 0:
            continue
        surfels = surfel_map(target, surfel_cell_m)
        for p in range(submaps.first_pair[k], submaps.first_pair[k + 1]):
            query = pairs.queries[p]
            first, last = clouds.first_point[query], clouds.first_point[query + 1]
            step = max((last - first) // max_points, 1)
            scan = OrientedPoints(
                clouds.points[first:last:step].copy(), clouds.normals[first:last:step].copy()
            )
            start = pairs.starts[p]
            pose, found, used = register(surfels, scan, start, weak_prior(start), registration)
            poses[p], information[p] = pose, step * found
            ratio[p] = used / max(scan.points.shape[0], 1)
    return poses, information, ratio
