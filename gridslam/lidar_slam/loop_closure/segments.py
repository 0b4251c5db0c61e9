"""Segments: short stretches of consecutive key scans, the nodes of the pose graph, with what they have seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.scan_matching import segment_clouds
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.scans import PreparedScan, scan_set

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CLOUD_CELL_M = 0.1  # one surface point of a segment is kept in each cell
BEAM_STEP = 4  # every fourth beam is enough to draw the free space of many scans
MAX_RANGE_M = 20.0  # what lies farther away is sampled thinly, and a heading error moves it far
# Length that a radian of rotation adds to a segment: a robot that turns on the spot sees new things as well
METRES_PER_RADIAN = 0.5


@dataclass(frozen=True, slots=True)
class Segments:
    """Segment i holds the key scans first[i]..first[i + 1] - 1; key scan reference[i] carries its frame.

    `travel_m` `(s,)` is the distance travelled from the first key scan to the reference. The segments may belong to several
    tracks: track t owns the segments tracks[t]..tracks[t + 1] - 1; without `tracks` there is one.
    """

    first: Ints
    reference: Ints
    travel_m: Floats
    tracks: Ints | None = None

    def __len__(self) -> int:
        return len(self.reference)

    @property
    def limits(self) -> Ints:
        """First and last segment `(s, 2)` of each segment's track: a submap about it stays within them."""
        tracks = np.array([0, len(self)]) if self.tracks is None else self.tracks
        return np.repeat(np.stack([tracks[:-1], tracks[1:] - 1], axis=1), np.diff(tracks), axis=0)


def cut_segments(track: Floats, length_m: float) -> Segments:
    """Cut the key scans' poses `(n, 3)`, n > 0, into segments of `length_m` of travel, each with at least one key scan."""
    steps = se2.between(track[:-1], track[1:])
    distance = np.hypot(steps[:, 0], steps[:, 1])
    travel = np.concatenate([[0.0], np.cumsum(distance)])
    progress = np.concatenate([[0.0], np.cumsum(distance + METRES_PER_RADIAN * np.abs(steps[:, 2]))])
    first = np.flatnonzero(np.diff(np.floor(progress / length_m), prepend=-1.0) > 0)
    bounds = np.append(first, len(track)).astype(np.int64)
    reference = (bounds[:-1] + bounds[1:] - 1) // 2
    return Segments(bounds, reference, travel[reference])


def collect_clouds(scans: Sequence[PreparedScan], poses: Floats, segments: Segments) -> SegmentClouds:
    """Surfaces and beams of every segment, seen from the key scans' poses `(n, 3)`."""
    clouds, beams = [], []
    for index, reference in enumerate(segments.reference):
        members = slice(segments.first[index], segments.first[index + 1])
        local = se2.between(poses[reference], poses[members])
        own = scans[members]
        if not any(len(scan.returns) for scan in own):
            clouds.append(OrientedPoints(np.zeros((0, 2)), np.zeros((0, 2))))
            beams.append(np.zeros((0, 4)))
            continue
        viewpoints = np.array([scan.viewpoint for scan in own])
        surfaces = scan_set([scan.surface_points for scan in own])
        clouds.append(segment_clouds.segment_cloud(surfaces, local, viewpoints, CLOUD_CELL_M, MAX_RANGE_M))
        returns = np.concatenate([scan.returns for scan in own])
        first = offsets_of(len(scan.returns) for scan in own)
        beams.append(
            segment_clouds.segment_beams(
                returns, first, poses=local, viewpoints=viewpoints, step=BEAM_STEP, max_range_m=MAX_RANGE_M
            )
        )
    points = [cloud.points for cloud in clouds]
    return SegmentClouds(
        np.concatenate(points),
        np.concatenate([cloud.normals for cloud in clouds]),
        offsets_of(map(len, points)),
        np.concatenate(beams),
        offsets_of(map(len, beams)),
    )


def track_edges(track: Floats, segments: Segments, drift: DriftModel) -> Edges:
    """The front end's motions from segment to segment, given its poses `(n, 3)` of the key scans."""
    variances = drift.cumulative_variances(track)[segments.reference]
    at = track[segments.reference]
    n = len(segments)
    information = (1.0 / np.diff(variances, axis=0))[:, :, None] * np.eye(3)
    motions = se2.between(at[:-1], at[1:])
    return Edges(np.arange(n - 1), np.arange(1, n), motions, information, np.zeros(n - 1, np.bool_))


def deform_track(track: Floats, segments: Segments, poses: Floats) -> Floats:
    """The key scans' poses `(n, 3)` when the segments' references are moved to `poses` `(s, 3)`.

    Between two references a key scan is blended from where each of them would take it along the track.
    """
    at = segments.reference
    if len(at) == 1:
        return np.asarray(se2.compose(poses[0], se2.between(track[at[0]], track)))
    index = np.arange(len(track))
    left = np.clip(np.searchsorted(at, index, side="right") - 1, 0, len(at) - 2)
    fraction = np.clip((index - at[left]) / (at[left + 1] - at[left]), 0.0, 1.0)
    from_left = se2.compose(poses[left], se2.between(track[at[left]], track))
    from_right = se2.compose(poses[left + 1], se2.between(track[at[left + 1]], track))
    return se2.interpolate(from_left, from_right, fraction)
