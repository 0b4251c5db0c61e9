"""Several tracks cut into the segments of one pose graph."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.segments import Segments, cut_segments, deform_track, track_edges
from gridslam.lidar_slam.sessions.session import Drive

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

APART_M = 1000.0  # travel put between two tracks: as far apart as two passages ever have to be


@dataclass(frozen=True, slots=True)
class JointTracks:
    """The segments of all tracks as one, those of each track on its own, and the tracks' key scans.

    Track t owns the key scans first_key[t]..first_key[t + 1] - 1.
    """

    tracks: Sequence[Floats]
    own: Sequence[Segments]
    joint: Segments
    first_key: Ints

    @staticmethod
    def cut(drives: Sequence[Drive], length_m: float) -> JointTracks:
        """Segments of a length in the tracks of drives."""
        tracks = [drive.key_track for drive in drives]
        own = [cut_segments(track, length_m) for track in tracks]
        first_key = offsets_of([len(track) for track in tracks])
        travel, travelled_m = [], 0.0
        for part in own:
            travel.append(part.travel_m + travelled_m)
            travelled_m = float(travel[-1][-1]) + APART_M
        joint = Segments(
            np.concatenate(
                [*(part.first[:-1] + k for part, k in zip(own, first_key[:-1], strict=True)), first_key[-1:]]
            ),
            np.concatenate([part.reference + k for part, k in zip(own, first_key[:-1], strict=True)]),
            np.concatenate(travel),
            offsets_of([len(part) for part in own]),
        )
        return JointTracks(tracks, own, joint, first_key)

    @property
    def first_segment(self) -> Ints:
        """Indices `(tracks + 1,)`: track t owns the joint segments first_segment[t]..first_segment[t + 1] - 1."""
        assert self.joint.tracks is not None
        return self.joint.tracks

    def chains(self, drift: DriftModel) -> Edges:
        """The front end's motions along every track."""
        parts = []
        for track, own, first in zip(self.tracks, self.own, self.first_segment[:-1], strict=True):
            edges = track_edges(track, own, drift)
            parts.append(replace(edges, source=edges.source + first, target=edges.target + first))
        return Edges.concatenate(parts)

    def deformed(self, poses: Floats) -> Floats:
        """Poses `(k, 3)` of all key scans when the joint segments are moved to `poses` `(s, 3)`."""
        first = self.first_segment
        return np.concatenate(
            [
                deform_track(track, own, poses[first[t] : first[t + 1]])
                for t, (track, own) in enumerate(zip(self.tracks, self.own, strict=True))
            ]
        )

    def segment_of(self, key: Ints) -> Ints:
        """The joint segments `(k,)` that hold the key scans with these numbers `(k,)`."""
        return np.searchsorted(self.joint.first, key, side="right") - 1

    def between_segments(self, edges: Edges) -> Edges:
        """Edges between key scans as edges between their segments; those within one segment are left out."""
        source, target = self.segment_of(edges.source), self.segment_of(edges.target)
        track, at = np.concatenate(self.tracks), self.joint.reference
        before = se2.between(track[at[source]], track[edges.source])
        after = se2.between(track[edges.target], track[at[target]])
        motions = se2.compose(se2.compose(before, edges.T_source_target), after)
        moved = replace(edges, source=source, target=target, T_source_target=motions)
        return moved.select(source != target)

    def between_key_scans(self, edges: Edges) -> Edges:
        """Edges between segments as edges between the key scans that carry their frames."""
        at = self.joint.reference
        return replace(edges, source=at[edges.source], target=at[edges.target])
