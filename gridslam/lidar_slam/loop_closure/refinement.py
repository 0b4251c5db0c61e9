"""Registration of segments in submaps of other visits, a few for each: the poses to the centimetre.

A place that was visited many times costs no more than one that was visited three times: a segment is registered against the
first visit and the last one before it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.kernels.scan_matching.segment_registration import SegmentPairs, SubmapMembers, register_segments
from gridslam.kernels.scan_matching.surfel_registration import Registration
from gridslam.lidar_slam.loop_closure.segments import Segments

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

VIEW_M = 8.0  # largest distance between the references of two segments that see enough of the same
MIN_TRAVEL_M = 5.0  # smallest travel between two segments: closer ones share a local map of the front end
HALF_SUBMAP_SEGMENTS = 4  # number of segments on each side of a submap's centre
MAX_VISITS = 2
MAX_GAP_SEGMENTS = 2  # longest gap within one passage
MAX_POINTS = 200  # largest number of points of a segment
SURFEL_CELL_M = 0.2
MIN_INLIER_RATIO = 0.6
INFORMATION_WEIGHT = 0.03  # weight of a match: the errors of neighbouring points are not independent
REGISTRATION = Registration(
    sigma_m=0.05,
    max_correspondence_m=0.3,  # the error of the poses after the loops are closed
    final_correspondence_m=0.1,
    max_iterations=12,
    min_correspondences=0.0,
)


def choose_pairs(
    poses: Floats, travel_m: Floats, first_query: int = 0, seeing: Ints | None = None
) -> tuple[Ints, Ints]:
    """Targets `(p,)` and queries `(p,)`, sorted by target: which segments are registered about which.

    Of each visit the segment nearest to the query is its target. Queries are the segments from `first_query` on. `seeing` are
    the segments that have seen anything, in order; None: all.
    """
    seeing = np.arange(len(poses)) if seeing is None else seeing
    near = seeing[cKDTree(poses[seeing, :2]).query_pairs(VIEW_M, output_type="ndarray")]
    near = near[np.abs(travel_m[near[:, 1]] - travel_m[near[:, 0]]) >= MIN_TRAVEL_M]
    near = near[near.max(axis=1, initial=0) >= first_query]
    target, query = near.min(axis=1, initial=len(poses)), near.max(axis=1, initial=0)
    order = np.lexsort((target, query))
    targets: list[int] = []
    queries: list[int] = []
    for q, earlier in _runs_of(query[order], target[order]):
        visits = np.split(earlier, np.flatnonzero(np.diff(earlier) > MAX_GAP_SEGMENTS) + 1)
        chosen = visits if len(visits) <= MAX_VISITS else [visits[0], *visits[1 - MAX_VISITS :]]
        targets += [int(v[np.argmin(np.hypot(*(poses[v, :2] - poses[q, :2]).T))]) for v in chosen]
        queries += [q] * len(chosen)
    t, q_all = np.array(targets, np.int64), np.array(queries, np.int64)
    order = np.lexsort((q_all, t))
    return t[order], q_all[order]


def register_visits(poses: Floats, segments: Segments, clouds: SegmentClouds, first_query: int = 0) -> Edges:
    """Edges `target` to `query` from the registration of segments from `first_query` on, given all poses `(s, 3)`."""
    seeing = np.flatnonzero(np.diff(clouds.first_point))
    target, query = choose_pairs(poses, segments.travel_m, first_query, seeing)
    if not len(target):
        return Edges.none()
    centres, counts = np.unique(target, return_counts=True)
    lowest, highest = segments.limits[centres].T
    first = np.maximum(centres - HALF_SUBMAP_SEGMENTS, lowest)
    last = np.minimum(centres + HALF_SUBMAP_SEGMENTS, highest)
    members = [se2.between(poses[c], poses[a : b + 1]) for c, a, b in zip(centres, first, last, strict=True)]
    submaps = SubmapMembers(
        first, last, offsets_of(last - first + 1), np.concatenate(members), offsets_of(counts)
    )
    pairs = SegmentPairs(query, se2.between(poses[target], poses[query]))
    found, information, inlier_ratio = register_segments(
        clouds,
        submaps,
        pairs=pairs,
        max_points=MAX_POINTS,
        surfel_cell_m=SURFEL_CELL_M,
        registration=REGISTRATION,
    )
    good = inlier_ratio >= MIN_INLIER_RATIO
    weighted = INFORMATION_WEIGHT * information[good]
    return Edges(target[good], query[good], found[good], weighted, np.ones(int(good.sum()), np.bool_))


def _runs_of(keys: Ints, values: Ints) -> Iterator[tuple[int, Ints]]:
    """Each key with its values; the keys are sorted."""
    if not len(keys):
        return
    starts = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
    for start, end in zip(starts, [*starts[1:], len(keys)], strict=True):
        yield int(keys[start]), values[start:end]
