"""Loop candidates: pairs of segments whose uncertainty lets them show the same place, and how they are matched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import offsets_of
from gridslam.core.poses import rotate_covariance
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import unpacked
from gridslam.kernels import relative_covariance
from gridslam.kernels.relative_covariance import CandidateLimits, DirectedEdges
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.kernels.scan_matching.submap_matching import SubmapDrawing, SubmapPairs, match_submaps
from gridslam.kernels.scan_matching.surfel_registration import Registration
from gridslam.kernels.scan_matching.window_search import WindowSearch
from gridslam.lidar_slam.loop_closure.segments import Segments

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

# Smallest travel between the ends of a loop: a shorter one adds nothing to what the front end has used
MIN_TRAVEL_M = 25.0
VIEW_M = 4.0  # poses this close see the same walls, also in a corridor
MIN_STD_M = 0.12  # what is known better is found by registration alone
# Standard deviations of the relative position that are allowed for in the choice of candidates
MAX_STDS = 2.5
WINDOW_STDS = 3.0
MIN_WINDOW_M, MIN_WINDOW_RAD = 0.6, 0.03
MAX_GAP_SEGMENTS = 2  # longest gap within one passage of a place
MAX_PASSAGES = 16  # largest number of passages of one place that are compared with one query

QUERY_SEGMENTS = 2  # number of segments on each side of the query that are matched together with it
TARGET_RANGE_M = 15.0  # range of the target submap beyond the search window
# Segments of a target on each side: within 75 m the track itself drifts by less than a cell or two
MAX_TARGET_SEGMENTS = 25

DRAWING = SubmapDrawing(max_points=500, field_cell_m=0.2, field_sigma_m=0.15, surfel_cell_m=0.2)
SEARCH = WindowSearch(yaw_step_rad=0.012, min_score=0.3, rival_distance_m=1.0, rival_yaw_rad=0.1)
REGISTRATION = Registration(
    sigma_m=0.05,
    max_correspondence_m=0.4,  # the search is right to a cell or two
    final_correspondence_m=0.2,
    max_iterations=15,
    min_correspondences=0.0,
)
INFORMATION_WEIGHT = 0.03  # weight of a match: the errors of neighbouring points are not independent
MIN_INFORMATION = np.diag([1e-2, 1e-2, 1.0])  # 10 m and 1 rad where the points determine nothing
# Standard deviation of the best match: the submaps themselves are distorted by as much
MATCH_STD_M, MATCH_STD_RAD = 0.03, 0.003


@dataclass(frozen=True, slots=True)
class Candidate:
    """Two segments that may show the same place.

    `covariance` `(3, 3)` is that of the target's pose given the query's, in the axes of the map; `std_m` the standard
    deviation of its position in the widest direction.
    """

    target: int
    query: int
    std_m: float
    covariance: Floats


@dataclass(frozen=True, slots=True)
class LoopMatches:
    """Matched candidates `(m,)`: edges from target to query, how uncertain they were, and how good the matches are.

    `score` is the mean likelihood (0..1, -1: nothing found), `rival_score` that of the best pose elsewhere in the window,
    `explained` and `contradicted` the fractions of points on surfaces of the target and in space that it has seen free.
    """

    edges: Edges
    std_m: Floats
    score: Floats
    rival_score: Floats
    explained: Floats
    contradicted: Floats

    def __len__(self) -> int:
        return len(self.edges)

    def select(self, rows: Ints | Bools) -> LoopMatches:
        """The matches of these rows: indices `(k,)` or a mask `(m,)`."""
        measures = (self.std_m, self.score, self.rival_score, self.explained, self.contradicted)
        return LoopMatches(self.edges.select(rows), *(measure[rows] for measure in measures))

    @staticmethod
    def none() -> LoopMatches:
        """No matches."""
        return LoopMatches(Edges.none(), *(np.zeros(0) for _ in range(5)))

    @staticmethod
    def concatenate(parts: Sequence[LoopMatches]) -> LoopMatches:
        """The matches of all parts, in order."""
        return LoopMatches(
            Edges.concatenate([p.edges for p in parts]),
            np.concatenate([p.std_m for p in parts]),
            score=np.concatenate([p.score for p in parts]),
            rival_score=np.concatenate([p.rival_score for p in parts]),
            explained=np.concatenate([p.explained for p in parts]),
            contradicted=np.concatenate([p.contradicted for p in parts]),
        )


def find_candidates(
    poses: Floats,
    travel_m: Floats,
    graph: DirectedEdges,
    max_std_m: float,
    first_query: int = 0,
    *,
    is_target: Bools,
) -> list[Candidate]:
    """All candidates with a standard deviation up to `max_std_m` (m), the least uncertain first.

    The segments have `poses` `(s, 3)`, the distances `travel_m` `(s,)` (m) driven up to them, and the edges of `graph`. Queries
    are the segments from `first_query` on, targets those that `is_target` `(s,)` marks.
    """
    limits = CandidateLimits(
        MIN_TRAVEL_M,
        VIEW_M,
        max_stds=MAX_STDS,
        min_std_m=MIN_STD_M,
        max_std_m=max_std_m,
        max_gap=MAX_GAP_SEGMENTS,
        first_query=first_query,
    )
    counts, nodes, covariances = relative_covariance.loop_candidates(
        poses, travel_m, graph, limits=limits, is_target=is_target, max_passages=MAX_PASSAGES
    )
    query, column = np.nonzero(np.arange(MAX_PASSAGES) < counts[:, None])
    target = nodes[query, column]
    matrices = unpacked(covariances[query, column])
    std = np.sqrt(np.linalg.eigvalsh(matrices[:, :2, :2])[:, 1])
    order = np.lexsort((query, target, std))
    return [Candidate(int(target[i]), int(query[i]), float(std[i]), matrices[i]) for i in order]


def match_candidates(
    candidates: Sequence[Candidate],
    poses: Floats,
    segments: Segments,
    segment_m: float,
    clouds: SegmentClouds,
) -> LoopMatches:
    """Search for every query's submap about its target, given the segments' poses `(s, 3)` and their length."""
    pairs = _submap_pairs(candidates, poses, segments.limits, segment_m)
    found = match_submaps(clouds, pairs, DRAWING, SEARCH, REGISTRATION)
    target = np.array([c.target for c in candidates])
    query = np.array([c.query for c in candidates])
    frames = np.array([_search_frame(poses[c.target], c.covariance) for c in candidates])
    T_target_frame = se2.between(poses[target], frames)
    motions = se2.compose(T_target_frame, found.poses)
    information = edge_information(found.information, T_target_frame[:, 2])
    edges = Edges(target, query, motions, information, np.ones(len(target), np.bool_))
    std_m = np.array([c.std_m for c in candidates])
    return LoopMatches(
        edges,
        std_m,
        score=found.scores,
        rival_score=found.rival_scores,
        explained=found.explained,
        contradicted=found.contradicted,
    )


def edge_information(information: Floats, yaw_rad: Floats) -> Floats:
    """Information `(m, 3, 3)` of edges from that of the registered points, in frames of the headings `(m,)` in the sources."""
    covariance = np.asarray(np.linalg.inv(INFORMATION_WEIGHT * information + MIN_INFORMATION), np.float64)
    covariance = rotate_covariance(covariance, yaw_rad)
    covariance += np.diag([MATCH_STD_M**2, MATCH_STD_M**2, MATCH_STD_RAD**2])
    return np.asarray(np.linalg.inv(covariance), np.float64)


def _search_frame(pose: Floats, covariance: Floats) -> Floats:
    """The frame of a target's search: at its pose, the first axis along the widest direction of the uncertainty."""
    direction = np.linalg.eigh(covariance[:2, :2])[1][:, 1]
    return np.array([pose[0], pose[1], np.arctan2(direction[1], direction[0])])


def _submap_pairs(
    candidates: Sequence[Candidate], poses: Floats, limits: Ints, segment_m: float
) -> SubmapPairs:
    """The submaps about the candidates' targets and queries, with the windows of the search.

    `limits` `(s, 2)` are the first and last segments of each segment's track.
    """
    spans, starts, windows = [], [], []
    target_poses, query_poses = [], []
    for c in candidates:
        std = np.sqrt(np.linalg.eigvalsh(c.covariance[:2, :2])[::-1])
        window = np.maximum(WINDOW_STDS * std, MIN_WINDOW_M)
        yaw = max(WINDOW_STDS * np.sqrt(c.covariance[2, 2]), MIN_WINDOW_RAD)
        (first, last), (query_first, query_last) = limits[c.target], limits[c.query]
        query = max(query_first, c.query - QUERY_SEGMENTS), min(query_last, c.query + QUERY_SEGMENTS)
        half = min(int(np.ceil((window[0] + TARGET_RANGE_M) / segment_m)), MAX_TARGET_SEGMENTS)
        target = max(first, c.target - half), min(c.target + half, last, query[0] - 1)
        frame = _search_frame(poses[c.target], c.covariance)
        spans.append((*target, *query))
        target_poses.append(se2.between(frame, poses[target[0] : target[1] + 1]))
        query_poses.append(se2.between(poses[c.query], poses[query[0] : query[1] + 1]))
        starts.append(se2.between(frame, poses[c.query]))
        windows.append((*window, yaw))
    columns = np.array(spans, np.int64).T.copy()
    return SubmapPairs(
        target_first=columns[0],
        target_last=columns[1],
        target_row=offsets_of(map(len, target_poses)),
        target_poses=np.concatenate(target_poses),
        query_first=columns[2],
        query_last=columns[3],
        query_row=offsets_of(map(len, query_poses)),
        query_poses=np.concatenate(query_poses),
        starts=np.array(starts),
        windows=np.array(windows),
    )
