"""Loops closed in the order of their certainty, on the graph of the segments.

What lies close along the graph is searched for first, in small windows without look-alikes. Every accepted loop makes the rest of
the graph more certain, so that most places are searched for in small windows in the end. A loop is accepted if others say
the same, or if nothing else in its whole window comes near it; the others wait, and are judged again when the graph has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gridslam.graph.loop_consistency import CHI2_3DOF_99, departures, largest_cliques, pairwise_disagreement
from gridslam.graph.pose_graph import Edges, optimise
from gridslam.graph.relative_covariance import directed_edges
from gridslam.kernels.relative_covariance import DirectedEdges
from gridslam.kernels.scan_matching.segment_clouds import SegmentClouds
from gridslam.lidar_slam.loop_closure.search import Candidate, LoopMatches, find_candidates, match_candidates
from gridslam.lidar_slam.loop_closure.segments import Segments

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Uncertainty up to which loops are searched for: doubled when nothing is left
FIRST_STD_M, MAX_STD_M = 0.5, 40.0
MAX_ROUNDS = 60
# Segments between the searches of one round: a loop that is found narrows the search of its neighbours
QUERY_SPACING, TARGET_SPACING = 4, 6
# Segments from an earlier search, within which another one would find the same
TRIED_QUERY, TRIED_TARGET = 2, 3
TRIED_RATIO = 0.6  # unless the uncertainty has shrunk to this fraction: what was ambiguous may not be now

# Limits of a match that is compared with others. They are looser than those of a match that stands alone, below, because other
# Matches must confirm it.
MIN_SCORE = 0.5  # smallest score of the search, at most 1
MIN_EXPLAINED = 0.5  # smallest fraction of the query's points on surfaces of the target
MAX_CONTRADICTED = 0.15  # largest fraction of them in space that the target has seen free
MAX_RIVAL_RATIO = 0.95  # largest ratio of the rival's score to the match's
DISTINCT_RIVAL_RATIO = 0.85  # largest such ratio of at least one of several matches that agree
# Limits of a match that stands alone
SURE_RIVAL_RATIO, SURE_SCORE, SURE_EXPLAINED, SURE_CONTRADICTED = 0.75, 0.7, 0.7, 0.08
MAX_DEPARTURE = 2.5  # standard deviations of a match from where it was expected: what lies beyond is more often a look-alike
MEANINGFUL_STD_RATIO = 0.5  # agreement counts where it was expected to this fraction of the uncertainty

ROBUST_SCALE = 4.0  # scale of the robust kernel on loops, in standard deviations
REJECTED_WEIGHT = 0.25  # a loop with a smaller robust weight is taken out again


@dataclass(slots=True)
class ClosedLoops:
    """Poses `(s, 3)` of the segments, the loops that hold them, and the matches that were not accepted or taken out again."""

    poses: Floats
    accepted: LoopMatches = field(default_factory=LoopMatches.none)
    pending: LoopMatches = field(default_factory=LoopMatches.none)
    removed: list[LoopMatches] = field(default_factory=list)
    pairs_searched: int = 0

    @property
    def rejected(self) -> LoopMatches:
        """All matches that hold nothing."""
        return LoopMatches.concatenate([self.pending, *self.removed])


def close_loops(
    start: ClosedLoops,
    fixed: Edges,
    segments: Segments,
    segment_m: float,
    clouds: SegmentClouds,
    first_query: int = 0,
) -> ClosedLoops:
    """Find loops between segments of `segment_m` (m) and optimise the segments' poses, both from a start.

    `clouds` are the segments' points and beams.     `fixed` are the edges that hold whatever is found: the front end's motions
    and landmarks. Loops are searched for from the segments from `first_query` on, to all before them.
    """
    closed = replace(start, poses=start.poses.copy())
    if len(fixed) + len(closed.accepted) >= len(segments):  # landmarks, beyond the chain
        held = Edges.concatenate([fixed, closed.accepted.edges])
        closed.poses, _ = optimise(closed.poses, held, ROBUST_SCALE)
    tried: list[Candidate] = []
    max_std_m = FIRST_STD_M
    find = partial(
        find_candidates,
        travel_m=segments.travel_m,
        first_query=first_query,
        is_target=np.diff(clouds.first_point) > 0,
    )
    for _ in range(MAX_ROUNDS):
        graph = directed_edges(len(segments), Edges.concatenate([fixed, closed.accepted.edges]))
        found = find(closed.poses, graph=graph, max_std_m=max_std_m)
        candidates = choose_candidates(found, tried)
        while not candidates and max_std_m < MAX_STD_M:
            max_std_m *= 2.0
            found = find(closed.poses, graph=graph, max_std_m=max_std_m)
            candidates = choose_candidates(found, tried)
        if not candidates:
            break
        tried += candidates
        closed.pairs_searched += len(candidates)
        matches = match_candidates(candidates, closed.poses, segments, segment_m, clouds)
        pool = LoopMatches.concatenate([closed.pending, matches.select(_is_plausible(matches))])
        accepted = is_supported(closed.poses, graph, pool)
        closed.pending = pool.select(~accepted)
        if accepted.any():
            _accept(closed, fixed, pool.select(accepted))
    return closed


def choose_candidates(found: Sequence[Candidate], tried: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, in order, that are apart from each other and were not searched for before in about as wide a window."""
    chosen: list[Candidate] = []
    for c in found:
        if _any_near(c, chosen, TARGET_SPACING, QUERY_SPACING):
            continue
        wide = [t for t in tried if c.std_m > TRIED_RATIO * t.std_m]
        if not _any_near(c, wide, TRIED_TARGET + 1, TRIED_QUERY + 1):
            chosen.append(c)
    return chosen


def _any_near(c: Candidate, others: Sequence[Candidate], target: int, query: int) -> bool:
    return any(abs(c.target - o.target) < target and abs(c.query - o.query) < query for o in others)


def _is_plausible(matches: LoopMatches) -> Bools:
    """Mask `(m,)` of the matches that are good enough to be compared with others."""
    return np.asarray(
        (matches.score >= MIN_SCORE)
        & (matches.explained >= MIN_EXPLAINED)
        & (matches.contradicted <= MAX_CONTRADICTED)
        & (matches.rival_score <= MAX_RIVAL_RATIO * matches.score)
    )


def is_supported(poses: Floats, graph: DirectedEdges, pool: LoopMatches) -> Bools:
    """Mask `(m,)` of the accepted matches: sets that agree with a distinct one among them, and matches that are sure alone.

    Matches far from where the graph expects them are rejected: where the right place was never mapped, only look-alikes are
    found, and they agree with each other.
    """
    accepted = np.zeros(len(pool), np.bool_)
    if not len(pool):
        return accepted
    expected = np.flatnonzero(departures(poses, graph, pool.edges) <= MAX_DEPARTURE)
    pool = pool.select(expected)
    chi2, std_m = pairwise_disagreement(poses, graph, pool.edges)
    meaningful = std_m < MEANINGFUL_STD_RATIO * np.minimum(pool.std_m[:, None], pool.std_m[None])
    is_consistent = (chi2 < CHI2_3DOF_99) & meaningful
    np.fill_diagonal(is_consistent, False)
    distinct = pool.rival_score <= DISTINCT_RIVAL_RATIO * pool.score
    sure = (
        (pool.rival_score <= SURE_RIVAL_RATIO * pool.score)
        & (pool.score >= SURE_SCORE)
        & (pool.explained >= SURE_EXPLAINED)
        & (pool.contradicted <= SURE_CONTRADICTED)
    )
    for clique in largest_cliques(is_consistent):
        accepted[expected[clique]] = (len(clique) > 1 and distinct[clique].any()) or sure[clique].any()
    return accepted


def _accept(closed: ClosedLoops, fixed: Edges, fresh: LoopMatches) -> None:
    """Add loops and optimise; loops that the rest of the graph contradicts are taken out again."""
    accepted = LoopMatches.concatenate([closed.accepted, fresh])
    poses, weights = optimise(closed.poses, Edges.concatenate([fixed, accepted.edges]), ROBUST_SCALE)
    is_accepted = weights[len(fixed) :] >= REJECTED_WEIGHT
    if not is_accepted.all():
        closed.removed.append(accepted.select(~is_accepted))
        accepted = accepted.select(is_accepted)
        poses, _ = optimise(closed.poses, Edges.concatenate([fixed, accepted.edges]), ROBUST_SCALE)
    closed.accepted, closed.poses = accepted, poses
