"""Loop closure and pose graph optimisation over the whole trajectory, after the last scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.lidar_slam.loop_closure.closure import ROBUST_SCALE, ClosedLoops, close_loops
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.refinement import register_visits
from gridslam.lidar_slam.loop_closure.segments import (
    Segments,
    collect_clouds,
    cut_segments,
    deform_track,
    track_edges,
)
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SEGMENT_M = 3.0  # length of a segment for the search
REFINED_SEGMENT_M = 1.0  # length of a segment for the registration afterwards


@dataclass(frozen=True, slots=True)
class ClosedTrajectory:
    """Optimised poses `(n, 3)` of the key scans, and how they came about.

    `loops` are the accepted loop closures between key scans. `unspanned` `(u, 2)` are the first and last key scan of every
    stretch that no loop spans: the front end alone holds it. The longest of them is `longest_unspanned_m`.
    """

    poses: Floats
    loops: Edges
    loops_rejected: int
    unspanned: Ints
    longest_unspanned_m: float
    pairs_searched: int
    visits: Edges

    @property
    def measures(self) -> dict[str, object]:
        """Numbers for the report."""
        return {
            "pairs_searched": self.pairs_searched,
            "loops_found": len(self.loops),
            "loops_rejected": self.loops_rejected,
            "matches": len(self.visits),
            "longest_unspanned_m": round(self.longest_unspanned_m, 1),
        }


def close_trajectory(
    scans: Sequence[PreparedScan],
    track: Floats,
    landmarks: Edges | None = None,
    drift: DriftModel | None = None,
) -> ClosedTrajectory:
    """Optimised poses of the key scans, of which there is at least one; the first one stays where it is.

    `track` `(n, 3)` are the front end's poses of the scans; `landmarks` are further edges between key scans.
    """
    drift = drift or DriftModel()
    segments = cut_segments(track, SEGMENT_M)
    fixed = _fixed_edges(track, segments, drift, landmarks)
    start = ClosedLoops(track[segments.reference])
    closed = close_loops(start, fixed, segments, SEGMENT_M, collect_clouds(scans, track, segments))
    poses = deform_track(track, segments, closed.poses)
    fine = cut_segments(track, REFINED_SEGMENT_M)
    at = poses[fine.reference]
    matches = register_visits(at, fine, collect_clouds(scans, poses, fine))
    if len(matches):
        edges = Edges.concatenate([_fixed_edges(track, fine, drift, landmarks), matches])
        at, _ = optimise(at, edges, ROBUST_SCALE)
        poses = deform_track(track, fine, at)
    poses = np.asarray(se2.compose(se2.compose(track[0], se2.inverse(poses[0])), poses))
    poses[0] = track[0]
    loops = closed.accepted.edges
    unspanned = unspanned_stretches(loops, segments, len(track))
    travel_m = cumulative_distance(track)
    return ClosedTrajectory(
        poses,
        _edges_between_key_scans(loops, segments),
        loops_rejected=len(closed.rejected),
        unspanned=unspanned,
        longest_unspanned_m=float(np.diff(travel_m[unspanned], axis=1).max(initial=0.0)),
        pairs_searched=closed.pairs_searched,
        visits=_edges_between_key_scans(matches, fine),
    )


def _fixed_edges(track: Floats, segments: Segments, drift: DriftModel, landmarks: Edges | None) -> Edges:
    """The front end's motions, and the landmarks between the segments of their key scans."""
    chain = track_edges(track, segments, drift)
    if landmarks is None or not len(landmarks):
        return chain
    source = np.searchsorted(segments.first, landmarks.source, side="right") - 1
    target = np.searchsorted(segments.first, landmarks.target, side="right") - 1
    before = se2.between(track[segments.reference[source]], track[landmarks.source])
    after = se2.between(track[landmarks.target], track[segments.reference[target]])
    motions = se2.compose(se2.compose(before, landmarks.T_source_target), after)
    between = source != target
    moved = Edges(source, target, motions, landmarks.information, landmarks.is_loop)
    return Edges.concatenate([chain, moved.select(between)])


def _edges_between_key_scans(edges: Edges, segments: Segments) -> Edges:
    """The same edges, with key scans as nodes instead of segments."""
    at = segments.reference
    return replace(edges, source=at[edges.source], target=at[edges.target])


def unspanned_stretches(loops: Edges, segments: Segments, n_keys: int) -> Ints:
    """First and last key scans `(u, 2)` of the stretches that no loop spans: a cut there leaves the graph in two parts."""
    spanned = np.zeros(len(segments) + 1, np.int64)
    np.add.at(spanned, np.minimum(loops.source, loops.target), 1)
    np.add.at(spanned, np.maximum(loops.source, loops.target), -1)
    free = np.concatenate([[False], np.cumsum(spanned)[: len(segments) - 1] == 0, [False]])
    change = np.flatnonzero(np.diff(free.astype(np.int64)))
    starts, ends = change[::2], change[1::2]
    at = segments.reference
    stretches = np.stack([at[starts], at[ends]], axis=1) if len(starts) else np.zeros((0, 2), np.int64)
    if len(stretches):
        stretches[0, 0] = 0 if starts[0] == 0 else stretches[0, 0]
        stretches[-1, 1] = n_keys - 1 if ends[-1] == len(segments) - 1 else stretches[-1, 1]
    return stretches.astype(np.int64)
