"""Comparison of the tracked pose with hypotheses from a search of the whole map.

Augmented MCL draws random poses when the agreement with the map falls; in a building almost none of them is near the robot. Here
the poses come from the scans. The tracked pose and the hypotheses are scored by the same evidence, so that a filter that is right
keeps its particles.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.particles import Belief, Particles
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation
from gridslam.methods.ispace_mcl.mirror_check import MirrorCheck
from gridslam.methods.ispace_mcl.search.hypothesis_particles import (
    mixture,
    sample_hypotheses,
    with_overlooked,
)
from gridslam.methods.ispace_mcl.search.hypothesis_scores import kidnapping_log_odds, with_kidnapping
from gridslam.methods.ispace_mcl.weighing import RANDOM_WEIGHT
from gridslam.methods.ispace_mcl.window import PastScan, ScanWindow
from gridslam.sensors.likelihood_field import log_likelihood_table
from gridslam.sensors.pose_search import (
    PoseHypotheses,
    PoseSearch,
    PoseSearchSettings,
    best_per_bin,
    climb,
)
from gridslam.sensors.visibility import BeamSegments, VisibilityField

Floats = NDArray[np.float64]
LogLikelihood = Callable[[Floats], Floats]
CameraLogLikelihood = Callable[[Sequence[CameraObservation], Floats], Floats]

BIN_M, BIN_RAD = 0.5, 0.26  # one hypothesis for each bin of position and heading
SEARCH = PoseSearchSettings(
    spacing_m=0.3,
    headings=120,
    sigma_m=0.3,  # wide, so that the true pose scores between two positions of the search
    points=64,
    max_poses=3_000_000,  # 2,000 m2 of free space at this spacing; on larger maps the spacing grows
    refined=3000,
    hypotheses=1000,  # of these, the most that are scored with visibility
    bin_m=BIN_M,
    bin_rad=BIN_RAD,
)
FINALISTS = 200  # number of these that are compared with the tracked pose at most

MATCH_STD_M = 0.2  # standard deviation of the window's points about walls: matched scans add their own error
BEAM_WEIGHT = 0.1  # power of a beam's likelihood: neighbouring beams have common errors
# Travel (m) whose surfaces are searched for together, and the largest number of beams to them: the shorter one shows a place
# that the robot was carried to, the longer one is distinct on maps that have aged
SEARCHED = ((4.0, 300), (10.0, 400))
MORE_RATIO = 1.3  # the longer one is searched for if it has this many times the beams of the shorter one
LATEST_SCANS = 10  # number of scans of about the shorter one
CLIMB_BEAMS = 100  # number of these by which a pose climbs to its maximum; all of them score it there
MIN_BEAMS = 10  # with fewer beams nothing is searched for
PAST_BEAMS = 30  # number of beams of each scan over which a hypothesis is traced back
SURFACE_WEIGHT = 0.15  # power of the likelihood of a beam to a piece of a surface
MAX_SCAN_LOG_ODDS = 1.2  # largest log-odds between two poses from one scan: a place may have changed ...
# ... unless it agrees with the map at one of the two: a changed place explains no lower score than this
CHANGED_SCORE = -2.5
SWITCH_LOG_ODDS = 2.0  # lead of a hypothesis from which it takes over from the tracked pose ...
# ... and more by this for what it leaves unexplained: the best of many leads by chance
SWITCH_UNEXPLAINED = 0.1
CONFIRM_LOG_ODDS = 2.0  # lead of the tracked pose that confirms it ...
# ... and more by this for what it leaves unexplained beyond MEAN_SCORE a scan: the map has aged
CONFIRM_UNEXPLAINED = 0.7
MEAN_SCORE = -0.7
# Lead of a hypothesis over the last metres from which nothing else confirms the tracked pose
DOUBT_LOG_ODDS = 3.0
# Lead of the tracked pose from which it is the best one: enough where nothing in its scans contradicts the map
BEST_LOG_ODDS = 1.0
CONCENTRATED_MASS = 0.9  # weight of the main cluster from which the map is tested for being mirrored
BESIDE_M = 1.5  # the path drifts as much over the window: its older scans do not distinguish two poses that are as near

_SAME_M, _SAME_RAD = 0.75, 0.4  # a hypothesis nearer than this to the tracked pose is the same place
_CLIMB_ROUNDS, _CLIMB_SHRINK = 4, 0.7
_CLIMB_STEP = (0.1, 0.02)  # m, rad
_TRACING_STEPS = ((0.1, 0.02), (0.05, 0.01))  # m, rad: steps by which a past pose is drawn to the map ...
# ... off the odometry, whose errors are as large: along a corridor it could slide to any place.
_TRACING_STD = (0.1, 0.1, 0.03)


@dataclass(frozen=True, slots=True)
class TrackedPose:
    """The particles, their main cluster, and the log-odds in its favour from before the window."""

    particles: Particles
    belief: Belief
    prior_log_odds: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """Result of a comparison of the tracked pose with the hypotheses.

    `particles`: new particles; None if the tracked ones are kept. `is_best`: the tracked pose leads all hypotheses.
    `is_confirmed`: and it leads by enough for what its scans leave unexplained. `is_switch`: a hypothesis replaces the tracked
    pose. `scans`: number of latest scans that it explains; None: all.
    """

    particles: Particles | None
    is_confirmed: bool = False
    is_best: bool = False
    is_switch: bool = False
    scans: int | None = None


class Relocalizer:
    """Searches the map for the scans of a window, and compares the hypotheses with the tracked pose."""

    def __init__(
        self, search: PoseSearch, visibility: VisibilityField, by_cameras: CameraLogLikelihood
    ) -> None:
        self._search = search
        self._by_cameras = by_cameras  # log-likelihoods (n,) of poses (n, 3)
        self._visibility = visibility
        self._table = log_likelihood_table(visibility.field, MATCH_STD_M, RANDOM_WEIGHT)
        self.mirror_check = MirrorCheck(self.search, visibility)

    def search(self, beams: BeamSegments) -> PoseHypotheses:
        """Hypotheses about the robot's pose, best first; their scores are log-likelihoods of the beams."""
        coarse = self._search.search(beams.endpoints, self._table)
        scores = self._score(beams)(coarse.poses)
        first = np.argsort(-scores, kind="stable")[:FINALISTS]
        return self.refine(coarse.poses[first], beams)

    def refine(self, poses: Floats, beams: BeamSegments) -> PoseHypotheses:
        """The local maxima of the likelihood near the poses `(n, 3)`, one for each bin."""
        score = self._score(beams.thinned(CLIMB_BEAMS))
        scores = score(poses)
        step_m, step_rad = _CLIMB_STEP
        for _ in range(_CLIMB_ROUNDS):
            poses, scores = climb(score, poses, scores, step_m, step_rad)
            step_m, step_rad = _CLIMB_SHRINK * step_m, _CLIMB_SHRINK * step_rad
        scores = self._score(beams)(poses)
        return PoseHypotheses(*best_per_bin(poses, scores, BIN_M, BIN_RAD, len(poses)))

    def _score(self, beams: BeamSegments, beam_weight: float = BEAM_WEIGHT) -> LogLikelihood:
        return lambda poses: beam_weight * self._visibility.table_sums(self._table, beams, poses)

    def trace_back(self, poses: Floats, past: Sequence[PastScan]) -> Floats:
        """Log-likelihoods `(k, n)` of k past scans, latest first, for robots that are at poses `(n, 3)` now.

        Each pose is traced back along the odometry and drawn to the map at every scan: a hypothesis about the present must have
        been possible all along, to the map and to the fixed cameras. The first pose is that of the filter, and follows the poses
        that the filter had, because the odometry drifts. The log-odds of a single scan between two poses are bounded, because a
        place may have changed.
        """
        scores, by_cameras = np.zeros((2, len(past), len(poses)))
        for row, scan in enumerate(past):
            if scan.tracked is not None and _is_near(scan.tracked, poses[0], BESIDE_M):
                poses = np.concatenate([scan.tracked[None], poses[1:]])
            if len(scan.beams):
                predicted, score = poses, _held_at(self._score(scan.beams), poses)
                climbed = score(poses)
                for step_m, step_rad in _TRACING_STEPS:
                    poses, climbed = climb(score, poses, climbed, step_m, step_rad)
                scores[row] = _held_at(self._score(scan.surface, SURFACE_WEIGHT), predicted)(poses)
            if scan.observations:
                by_cameras[row] = self._by_cameras(scan.observations, poses)
            poses = se2.compose(poses, se2.inverse(scan.step))
        best = scores.max(axis=1, keepdims=True)
        bounded = np.maximum(scores, np.minimum(best - MAX_SCAN_LOG_ODDS, CHANGED_SCORE))
        return np.asarray(bounded + by_cameras)

    def compare(
        self, window: ScanWindow, tracked: TrackedPose | None, count: int, rng: np.random.Generator
    ) -> Comparison | None:
        """Compare the tracked particles with the hypotheses of a search; None if the window has too few beams.

        `count` is the number of new particles.
        """
        beams, longer = (window.recent(*searched) for searched in SEARCHED)
        if len(beams) < MIN_BEAMS:
            return None
        found = self.search(beams)
        if len(longer) > MORE_RATIO * len(beams):
            poses = np.concatenate([found.poses, self.search(longer).poses])
            found = PoseHypotheses(
                *best_per_bin(poses, self._score(beams)(poses), BIN_M, BIN_RAD, len(poses))
            )
        past = window.past(PAST_BEAMS)
        if tracked is None:
            seen = past[0].observations
            scored = PoseHypotheses(found.poses, found.scores + self._by_cameras(seen, found.poses))
            return Comparison(sample_hypotheses(scored, count, rng), is_switch=True)
        own = self.refine(tracked.belief.mean[None], beams)
        if tracked.belief.mass > CONCENTRATED_MASS:
            self.mirror_check.add(beams, np.concatenate([own.poses[:1], found.poses]))
        others = _elsewhere(found.poses, own.poses[0])
        scores = self.trace_back(np.concatenate([own.poses[:1], others]), past)
        beside = np.r_[False, _is_near(others, own.poses[0], BESIDE_M)]
        scores[LATEST_SCANS:, beside] = scores[LATEST_SCANS:, :1]
        own_score = float(scores[:, 0].sum()) + tracked.prior_log_odds
        prices = kidnapping_log_odds(np.array([scan.overlap for scan in past]))
        by_scans, explained = with_kidnapping(scores[:, 1:], scores[:, 0], prices[:-1])
        found = PoseHypotheses(others, by_scans)
        best = float(found.scores.max(initial=-np.inf))
        lead = own_score - best
        if -lead > SWITCH_LOG_ODDS - SWITCH_UNEXPLAINED * best:
            particles = mixture(tracked.particles, own_score, found, count, rng)
            scans = int(explained[np.argmax(found.scores)])
            return Comparison(particles, is_switch=True, scans=scans if scans < len(past) else None)
        unexplained = max(MEAN_SCORE * len(past) - float(scores[:, 0].sum()), 0.0)
        is_best = lead > BEST_LOG_ODDS and _latest_lead(scores) > -DOUBT_LOG_ODDS
        is_confirmed = is_best and lead > CONFIRM_LOG_ODDS + CONFIRM_UNEXPLAINED * unexplained
        if lead > 0.0:
            return Comparison(None, is_confirmed, is_best)
        mass = _mass_near(others, tracked.particles)
        overlooked = PoseHypotheses(others[mass == 0.0], found.scores[mass == 0.0])
        joined = with_overlooked(tracked.particles, own_score, tracked.belief.mass, overlooked, rng)
        return Comparison(joined, is_confirmed, is_best)


def _latest_lead(scores: Floats) -> float:
    """The lead of the tracked pose by its latest scans alone.

    `scores` `(k, 1 + n)` are those of the scans, latest first, for the tracked pose and the hypotheses.
    """
    latest = scores[:LATEST_SCANS].sum(axis=0)
    return float(latest[0] - latest[1:].max(initial=-np.inf))


def _held_at(score: LogLikelihood, poses: Floats) -> LogLikelihood:
    """The score minus a penalty for the distance from the poses `(n, 3)` that the odometry predicts."""

    def held(tried: Floats) -> Floats:
        off = tried - np.repeat(poses, len(tried) // len(poses), axis=0)
        return np.asarray(score(tried) - 0.5 * np.sum((off / _TRACING_STD) ** 2, axis=1))

    return held


def _mass_near(poses: Floats, particles: Particles) -> Floats:
    """The total weight `(n,)` of the particles at each of the poses `(n, 3)`."""
    is_near = _is_near(poses[:, None, :], particles.poses, _SAME_M)
    return np.asarray(np.where(is_near, particles.weights, 0.0).sum(axis=1))


def _elsewhere(poses: Floats, pose: Floats) -> Floats:
    """The poses `(n, 3)` that are not near the pose `(3,)`."""
    return np.asarray(poses[~_is_near(poses, pose, _SAME_M)])


def _is_near(poses: Floats, others: Floats, distance_m: float) -> NDArray[np.bool_]:
    """Mask `(...)` of the pairs of poses `(..., 3)` within a distance of each other, with about the same heading."""
    off = poses - others
    is_near = np.hypot(off[..., 0], off[..., 1]) < distance_m
    return np.asarray(is_near & (np.abs(se2.wrap_angle(off[..., 2])) < _SAME_RAD))
