"""Search for the place of a drive in a map, without any prior: every part of the drive is searched for in the whole map.

The map is one submap, so that the strongest rival of a match is the best one anywhere else in the map. A place is accepted when
several parts of the drive, searched for one by one, put the drive in the same place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.graph.loop_consistency import CHI2_3DOF_99, largest_cliques, pairwise_disagreement
from gridslam.graph.pose_graph import Edges
from gridslam.graph.relative_covariance import directed_edges
from gridslam.kernels.relative_covariance import DirectedEdges
from gridslam.kernels.scan_matching.submap_matching import SubmapMatches
from gridslam.lidar_slam.loop_closure import search
from gridslam.lidar_slam.loop_closure.closure import (
    DISTINCT_RIVAL_RATIO,
    MAX_CONTRADICTED,
    MAX_RIVAL_RATIO,
    MIN_EXPLAINED,
    MIN_SCORE,
)
from gridslam.lidar_slam.loop_closure.search import LoopMatches
from gridslam.lidar_slam.sessions.whole_map import KnownMap, WholeMap, match_in, whole_map

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SPACINGS = 12, 6, 3  # segments between the parts that are searched for, until a place is found
UNKNOWN_STD_M = 100.0  # standard deviation of a place anywhere in the map
MIN_AGREEING = 3  # parts of the drive that put it in one place
MANY_AGREEING, MANY_LEAD = 6, 3.0  # then none of them has to be distinct, as a corridor looks alike all along
MIN_LEAD = 2.0  # times the parts that agree on any other place
# Fraction of a part's points that may lie in free space of the map, where doors and furniture have changed in between ...
MAX_CHANGED = 0.25
# ... if this number of parts agree, at least `MANY_LEAD` times those on any other place
MIN_AGREEING_CHANGED = 4
# Length of a drive in which too few parts can agree: one of them must be beyond doubt
SHORT_DRIVE_SEGMENTS = 9
CLEAR_SCORE, CLEAR_EXPLAINED, CLEAR_CONTRADICTED, CLEAR_RIVAL_RATIO = 0.8, 0.85, 0.03, 0.9
# The parts of the drive around those that agree lie in the map where these put them, or the place only looks alike there.
AROUND_SEGMENTS = 15  # on each side: over 45 m a drive drifts by less than the window (m, m, rad)
AROUND_WINDOW = 1.0, 1.0, 0.1
# Smallest fractions of a part's points on surfaces or in free space of the map, for the part to lie in the map, and to touch it
INSIDE, TOUCHING = 0.7, 0.4
# Smallest ratio of the parts that lie in the map and match it to those that touch it, of which there are at least `MIN_AROUND`
MIN_FITTING, MIN_AROUND = 0.3, 3
# If all of this number lie in the map and match, `MIN_AGREEING_CHANGED` parts are enough of which none is distinct
SURE_FITTING = 5
MARGIN_M = 10.0
SEARCH = search.SEARCH._replace(yaw_step_rad=0.024, min_score=MIN_SCORE)
SEARCH_AROUND = SEARCH._replace(min_score=0.05)  # so low that the agreement is known also where it is bad


def find_places(known: KnownMap, drive: KnownMap, first_query: int = 0) -> LoopMatches:
    """Loops from segments of a map to segments of a drive whose place in it is unknown; none if it is not found.

    Segments of the drive are numbered after those of the map. Those from `first_query` on are searched for.
    """
    union = whole_map(known)
    if not len(union.points):
        return LoopMatches.none()
    size, end = len(known.poses), len(drive.poses)
    own = end - first_query
    graph = directed_edges(size + end, Edges.concatenate([known.edges, _shifted(drive.edges, size)]))
    poses = np.concatenate([known.poses, drive.poses])
    tried: set[int] = set()
    pool = LoopMatches.none()
    for spacing in SPACINGS:
        first_of_drive = first_query + min(spacing // 2, own // 2)
        queries = [q for q in range(first_of_drive, end, spacing) if q not in tried]
        tried.update(queries)
        if not queries:
            continue
        found = _search(union, known.poses, drive, np.array(queries, np.int64))
        pool = LoopMatches.concatenate([pool, found])
        group, rival = _largest_group(poses, graph, pool)
        is_enough = _is_enough(group, rival, own)
        if not (is_enough or _is_many(len(group), rival, MIN_AGREEING_CHANGED)):
            continue
        fitting, touching = _fitting_around(union, known.poses, drive, group, first_query)
        if _is_borne_out(is_enough, fitting, touching):
            return group
    return LoopMatches.none()


def _largest_group(poses: Floats, graph: DirectedEdges, pool: LoopMatches) -> tuple[LoopMatches, int]:
    """The largest group of matches that put the drive in one place, and the size of the largest one elsewhere."""
    if not len(pool):
        return pool, 0
    chi2, _ = pairwise_disagreement(poses, graph, pool.edges)
    is_consistent = chi2 < CHI2_3DOF_99
    np.fill_diagonal(is_consistent, False)
    best, *others = largest_cliques(is_consistent)
    is_best = np.zeros(len(pool), np.bool_)
    is_best[best] = True
    return pool.select(is_best), len(others[0]) if others else 0


def _is_enough(group: LoopMatches, rival: int, own: int) -> bool:
    """Whether the matches of a group say by themselves where the `own` segments of a drive lie; `rival` of them say otherwise."""
    size = len(group)
    if not size or size < MIN_LEAD * rival:
        return False
    is_distinct = group.rival_score <= DISTINCT_RIVAL_RATIO * group.score
    is_unchanged = group.contradicted <= MAX_CONTRADICTED
    if is_unchanged.sum() >= MIN_AGREEING and (is_distinct & is_unchanged).any():
        return True
    if _is_many(size, rival, MIN_AGREEING_CHANGED) and is_distinct.any():
        return True
    is_clear = (
        (group.score >= CLEAR_SCORE)
        & (group.explained >= CLEAR_EXPLAINED)
        & (group.contradicted <= CLEAR_CONTRADICTED)
        & (group.rival_score <= CLEAR_RIVAL_RATIO * group.score)
    )
    return _is_many(size, rival, MANY_AGREEING) or (own < SHORT_DRIVE_SEGMENTS and bool(is_clear.any()))


def _is_many(size: int, rival: int, min_size: int) -> bool:
    return size >= max(min_size, MANY_LEAD * rival)


def _is_borne_out(is_enough: bool, fitting: int, touching: int) -> bool:
    """Whether parts around those that agree say the same, given the numbers of `_fitting_around`."""
    is_alike = touching >= MIN_AROUND and fitting < MIN_FITTING * touching
    return (is_enough and not is_alike) or fitting == touching >= SURE_FITTING


def _fitting_around(
    union: WholeMap, known_poses: Floats, drive: KnownMap, group: LoopMatches, first_query: int
) -> tuple[int, int]:
    """Numbers of parts of a drive around a group of matches: where it puts them, some lie in the map and match, some touch it."""
    matched = group.edges.target - len(known_poses)
    parts = np.arange(first_query, len(drive.poses), SPACINGS[-1])
    away = np.abs(parts[:, None] - matched[None])
    is_around = (away.min(axis=1) >= SPACINGS[-1]) & (away.min(axis=1) <= AROUND_SEGMENTS)
    parts, nearest = parts[is_around], away.argmin(axis=1)[is_around]
    if not len(parts):
        return 0, 0
    placed = se2.compose(known_poses[group.edges.source], group.edges.T_source_target)[nearest]
    expected = se2.compose(placed, se2.between(drive.poses[matched[nearest]], drive.poses[parts]))
    found = match_in(
        union, drive, parts, how=SEARCH_AROUND, starts=np.asarray(expected), window=np.array(AROUND_WINDOW)
    )
    known = found.explained + found.contradicted
    return int(((known >= INSIDE) & (found.explained >= MIN_EXPLAINED)).sum()), int((known >= TOUCHING).sum())


def _search(union: WholeMap, known_poses: Floats, drive: KnownMap, queries: Ints) -> LoopMatches:
    """Matches of segments of the drive, with their neighbours, in the whole map."""
    low, high = union.points.min(axis=0) - MARGIN_M, union.points.max(axis=0) + MARGIN_M
    centre = np.array([*(0.5 * (low + high)), 0.0])
    window = np.array([*(0.5 * (high - low)), np.pi])
    found = match_in(
        union, drive, queries, how=SEARCH, starts=np.tile(centre, (len(queries), 1)), window=window
    )
    is_plausible = (
        (found.scores >= MIN_SCORE)
        & (found.explained >= MIN_EXPLAINED)
        & (found.contradicted <= MAX_CHANGED)
        & (found.rival_scores <= MAX_RIVAL_RATIO * found.scores)
    )
    return _as_loops(found, known_poses, queries).select(is_plausible)


def _as_loops(found: SubmapMatches, known_poses: Floats, queries: Ints) -> LoopMatches:
    """Matches in the frame of the map as edges from its nearest segments."""
    target = np.asarray(cKDTree(known_poses[:, :2]).query(found.poses[:, :2])[1], np.int64)
    edges = Edges(
        target,
        queries + len(known_poses),
        np.asarray(se2.between(known_poses[target], found.poses)),
        search.edge_information(found.information, -known_poses[target, 2]),
        np.ones(len(queries), np.bool_),
    )
    return LoopMatches(
        edges,
        np.full(len(queries), UNKNOWN_STD_M),
        score=found.scores,
        rival_score=found.rival_scores,
        explained=found.explained,
        contradicted=found.contradicted,
    )


def _shifted(edges: Edges, by: int) -> Edges:
    return Edges(
        edges.source + by, edges.target + by, edges.T_source_target, edges.information, edges.is_loop
    )
