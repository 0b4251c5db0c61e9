"""A session continued by another drive: its place in the map, its loops to all earlier drives, and one optimised pose graph.

Earlier key scans are not matched among each other again: only what the new drive saw is searched for, and where several earlier
drives were in one place, in the last of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.graph.relative_covariance import reversed_covariances
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.lidar_slam.loop_closure.closure import ROBUST_SCALE, ClosedLoops, close_loops
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.refinement import register_visits
from gridslam.lidar_slam.loop_closure.search import LoopMatches
from gridslam.lidar_slam.loop_closure.segments import collect_clouds
from gridslam.lidar_slam.loop_closure.trajectory import REFINED_SEGMENT_M, SEGMENT_M
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.active_scans import active_scans
from gridslam.lidar_slam.sessions.place_search import find_places
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session
from gridslam.lidar_slam.sessions.tracks import JointTracks
from gridslam.lidar_slam.sessions.whole_map import KnownMap

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GAP_M = 5.0  # distance between parts of a map that do not overlap


@dataclass(frozen=True, slots=True)
class Continued:
    """The longer session, and what was searched for and found between the new drive and the earlier ones."""

    session: Session
    pairs_searched: int
    loops_to_earlier: int
    visits_of_earlier: int
    largest_correction_m: float

    @property
    def is_joined(self) -> bool:
        """Whether the new drive was found to overlap an earlier one."""
        parts = self.session.parts
        return bool((parts[:-1] == parts[-1]).any())


def continue_session(
    session: Session, drive: Drive, key_poses: Floats, constraints: Constraints, drift: DriftModel
) -> Continued:
    """The session with one more drive, given its final poses `(k, 3)` and its constraints when mapped on its own."""
    joined = Session((drive,), key_poses, np.zeros(1, np.int64), constraints)
    joined_drives = np.array([len(session.drives)])
    searched = loops = visits = 0
    for part in np.unique(session.parts):
        members = np.flatnonzero(session.parts == part)
        found = _join(_select(session, members), joined, drift)
        if found is None:
            continue
        order = np.concatenate([members, joined_drives])
        joined, joined_drives = found.session, order
        searched, loops, visits = searched + found.pairs_searched, loops + found.loops, visits + found.visits
    whole = _assemble(session, joined, joined_drives)
    whole = replace(whole, objects=session.objects, drawn=session.drawn)
    moved = np.hypot(*(whole.poses[: len(session.poses)] - session.poses)[:, :2].T)
    return Continued(whole, searched, loops, visits, round(float(moved.max()), 4))


@dataclass(frozen=True, slots=True)
class _Joined:
    session: Session
    pairs_searched: int
    loops: int
    visits: int


def _join(known: Session, fresh: Session, drift: DriftModel) -> _Joined | None:
    """One part of a map and drives that may lie in it, as one session; None if they are not found to overlap.

    The last drive of `fresh` is the new one.
    """
    drives = (*known.drives, *fresh.drives)
    both = Constraints.concatenate(
        [known.constraints, fresh.constraints.renumbered(np.arange(len(fresh.poses)) + len(known.poses))]
    )
    coarse = JointTracks.cut(drives, SEGMENT_M)
    at, size = coarse.joint.reference, int(coarse.first_segment[len(known.drives)])
    poses = np.concatenate([known.poses, fresh.poses])
    scans = [*active_scans(known), *(scan for drive in fresh.drives for scan in drive.scans)]
    clouds = collect_clouds(scans, poses, coarse.joint)
    fixed = Edges.concatenate([coarse.chains(drift), coarse.between_segments(both.landmarks)])
    held = coarse.between_segments(both.loops)
    first_query = int(coarse.first_segment[-2])
    first, second = _separate_maps(poses[at], clouds, Edges.concatenate([fixed, held]), size)
    places = _places(first, second, first_query - size)
    if not len(places):
        return None
    placed = np.concatenate([poses[at[:size]], _moved_into(poses[at], places, size)])
    start = ClosedLoops(placed, LoopMatches.concatenate([_known_loops(held), places]))
    closed = close_loops(
        start=start,
        fixed=fixed,
        segments=coarse.joint,
        segment_m=SEGMENT_M,
        clouds=clouds,
        first_query=first_query,
    )
    loops = coarse.between_key_scans(closed.accepted.edges)
    poses = coarse.deformed(closed.poses)
    poses, visits = _refine(drives, scans, poses, replace(both, loops=loops), drift)
    constraints = Constraints(loops, Edges.concatenate([both.visits, visits]), both.landmarks)
    session = Session(drives, poses, np.zeros(len(drives), np.int64), constraints)
    crossing = (loops.source < len(known.poses)) & (loops.target >= len(known.poses))
    return _Joined(session, closed.pairs_searched, int(crossing.sum()), len(visits))


def _known_loops(edges: Edges) -> LoopMatches:
    """Loops that were accepted in an earlier run."""
    return LoopMatches(edges, *(np.zeros(len(edges)) for _ in range(5)))


def _places(known: KnownMap, fresh: KnownMap, first_query: int) -> LoopMatches:
    """Loops from segments of one map to those of another from `first_query` on: the smaller is searched for in the larger."""
    size, new = len(known.poses), len(fresh.poses) - first_query
    if size >= new:
        return find_places(known, fresh, first_query)
    found = find_places(fresh, known)
    e = found.edges
    covariance = np.asarray(np.linalg.inv(e.information), np.float64) if len(e) else e.information
    turned = reversed_covariances(e.T_source_target, covariance)
    edges = Edges(
        e.target - len(fresh.poses),
        e.source + size,
        np.asarray(se2.inverse(e.T_source_target)),
        np.asarray(np.linalg.inv(turned), np.float64) if len(e) else turned,
        e.is_loop,
    )
    return replace(found, edges=edges)


def _separate_maps(
    poses: Floats, clouds: SegmentClouds, edges: Edges, size: int
) -> tuple[KnownMap, KnownMap]:
    """The first `size` segments and the others as maps of their own."""
    is_first = (edges.source < size) & (edges.target < size)
    is_second = (edges.source >= size) & (edges.target >= size)
    second = edges.select(is_second)
    second = replace(second, source=second.source - size, target=second.target - size)
    n = len(poses)
    return (
        KnownMap(poses[:size], _clouds_of(clouds, 0, size), edges.select(is_first)),
        KnownMap(poses[size:], _clouds_of(clouds, size, n), second),
    )


def _clouds_of(clouds: SegmentClouds, first: int, end: int) -> SegmentClouds:
    """The clouds of the segments first..end - 1."""
    p, b = clouds.first_point[first : end + 1], clouds.first_beam[first : end + 1]
    return SegmentClouds(
        clouds.points[p[0] : p[-1]],
        clouds.normals[p[0] : p[-1]],
        p - p[0],
        clouds.beams[b[0] : b[-1]],
        b - b[0],
    )


def _moved_into(poses: Floats, places: LoopMatches, size: int) -> Floats:
    """Poses of the segments from `size` on, moved as a whole to where the best of the loops puts them."""
    best = int(np.argmax(places.score))
    source, target = places.edges.source[best], places.edges.target[best]
    found = se2.compose(poses[source], places.edges.T_source_target[best])
    return np.asarray(se2.compose(se2.compose(found, se2.inverse(poses[target])), poses[size:]))


def _refine(
    drives: Sequence[Drive],
    scans: Sequence[PreparedScan],
    poses: Floats,
    known: Constraints,
    drift: DriftModel,
) -> tuple[Floats, Edges]:
    """Poses `(k, 3)` of all key scans after the new drive is registered in its surroundings, and these edges."""
    fine = JointTracks.cut(drives, REFINED_SEGMENT_M)
    at = poses[fine.joint.reference]
    first_query = int(fine.first_segment[-2])
    clouds = collect_clouds(scans, poses, fine.joint)
    visits = register_visits(at, fine.joint, clouds, first_query)
    earlier = fine.between_segments(Edges.concatenate([known.visits, known.landmarks]))
    is_earlier = earlier.target < first_query
    # Loops as well: where a drive is registered in few places, it would drift between these
    loops = fine.between_segments(known.loops)
    edges = Edges.concatenate([fine.chains(drift), earlier.select(is_earlier), visits, loops])
    at, _ = optimise(at, edges, ROBUST_SCALE)
    return fine.deformed(at), fine.between_key_scans(visits)


def _select(session: Session, members: Ints) -> Session:
    """Some of the drives, with what holds them."""
    first = session.first_key
    rows = np.concatenate([np.arange(first[d], first[d + 1]) for d in members])
    key = np.full(len(session.poses), -1, np.int64)
    key[rows] = np.arange(len(rows))
    return Session(
        tuple(session.drives[d] for d in members),
        session.poses[rows],
        session.parts[members],
        session.constraints.renumbered(key),
    )


def _assemble(session: Session, joined: Session, order: Ints) -> Session:
    """All drives in the order in which they were mapped: the joined ones, and the parts of the map that stay apart.

    A part that does not overlap is moved beside the others, as nothing says where it lies.
    """
    drives = (*session.drives, joined.drives[-1])
    others = np.setdiff1d(np.arange(len(drives)), order)
    apart = _select(session, others) if len(others) else None
    earliest = int(order.min())
    poses = joined.poses
    if earliest < len(session.drives):
        kept = session.poses_of(earliest)[0]
        start = joined.poses_of(int(np.argmin(order)))[0]
        poses = np.asarray(se2.compose(se2.compose(kept, se2.inverse(start)), poses))
    if apart is not None and 0 not in order:
        poses = _beside(apart, replace(joined, poses=poses))
    sources = [joined] if apart is None else [joined, apart]
    placed = {int(d): poses[joined.first_key[k] : joined.first_key[k + 1]] for k, d in enumerate(order)}
    if apart is not None:
        placed.update({int(d): apart.poses_of(k) for k, d in enumerate(others)})
    all_poses = np.concatenate([placed[d] for d in range(len(drives))])
    whole = Session(drives, all_poses, np.zeros(len(drives), np.int64), Constraints.none())
    first = whole.first_key
    constraints = []
    for source, numbers in zip(sources, (order, others), strict=False):
        key = np.concatenate([np.arange(first[d], first[d + 1]) for d in numbers])
        constraints.append(source.constraints.renumbered(key))
    parts = np.append(session.parts, session.parts.max() + 1)
    parts[order] = parts[order].min()
    return replace(whole, parts=parts, constraints=Constraints.concatenate(constraints))


def _beside(apart: Session, joined: Session) -> Floats:
    """Poses of the joined drives, moved to the right of those that they do not overlap."""
    right = max(_bounds(apart)[1][0], 0.0)
    low, high = _bounds(joined)
    other_low, other_high = _bounds(apart)
    shift = np.array(
        [np.ceil(right + GAP_M - low[0]), np.round(0.5 * (other_low + other_high - low - high)[1]), 0.0]
    )
    return np.asarray(joined.poses + shift)


def _bounds(session: Session) -> tuple[Floats, Floats]:
    """Lower and upper corner (2,) of the endpoints of all scans."""
    seen = np.concatenate(
        [
            se2.transform_points(pose, scan.returns)
            for pose, scan in zip(session.poses, session.scans, strict=True)
            if len(scan.returns)
        ]
        + [session.poses[:, :2]]
    )
    return seen.min(axis=0), seen.max(axis=0)
