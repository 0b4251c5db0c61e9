"""Registration of segments in submaps, many at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds, submap_points, surfel_map, weak_prior
from gridslam.kernels.scan_matching.surfel_registration import Registration, register
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.kernels.threads import run_in_ranges


class SegmentPairs(NamedTuple):
    """Registrations to do: segment `queries[i]`, from the initial pose `starts[i]` `(n, 3)`, in the submap that owns i."""

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


def register_segments(
    clouds: SegmentClouds,
    submaps: SubmapMembers,
    pairs: SegmentPairs,
    max_points: int,
    surfel_cell_m: float,
    registration: Registration,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Register segments in submaps: poses `(p, 3)`, information `(p, 3, 3)`, inlier ratios `(p,)`.

    `pairs` names the segment of `clouds` and the submap of `submaps` that belong together. Submaps are drawn with surface
    elements of `surfel_cell_m`, and `registration` sets the robust loss. At most about `max_points` of a segment are used; the
    information is scaled to all of its points.
    """
    n = pairs.starts.shape[0]
    poses, information, ratio = pairs.starts.copy(), np.zeros((n, 3, 3)), np.zeros(n)
    run_in_ranges(
        _register_segments,
        submaps.first.shape[0],
        (clouds, submaps, pairs, max_points, surfel_cell_m, registration, poses, information, ratio),
    )
    return poses, information, ratio


@compiled
def _register_segments(
    begin: int,
    end: int,
    clouds: SegmentClouds,
    submaps: SubmapMembers,
    pairs: SegmentPairs,
    max_points: int,
    surfel_cell_m: float,
    registration: Registration,
    poses: NDArray[np.float64],
    information: NDArray[np.float64],
    ratio: NDArray[np.float64],
) -> None:
    """Fill in the items begin to end - 1 of `register_segments`."""
    for k in range(begin, end):
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
            copy_row(poses, p, pose)
            for row in range(3):
                copy_row(information[p], row, step * found[row])
            ratio[p] = used / max(scan.points.shape[0], 1)
