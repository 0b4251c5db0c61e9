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
from gridslam.filters.resampling import systematic_resampling
from gridslam.methods.ispace_mcl.environment import CameraObservation
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
FINALISTS = 200  # of these, the most that are compared with the tracked pose

MATCH_STD_M = 0.2  # of the window's points about walls: matched scans add their own error
RANDOM_WEIGHT = 0.1  # weight of beams that the map does not explain
BEAM_WEIGHT = 0.1  # power of a beam's likelihood: neighbouring beams have common errors
MAX_BEAMS = 300  # of the window, equally many of each scan
MIN_BEAMS = 10  # with fewer, nothing is searched for
PAST_BEAMS = 30  # of each scan over which a hypothesis is traced back
MAX_SCAN_LOG_ODDS = 0.8  # that one scan can give to one pose against another: a place may have changed
KIDNAPPING_LOG_ODDS = 10.0  # against the robot having been carried elsewhere
SWITCH_LOG_ODDS = 2.0  # lead of a hypothesis from which it gets particles
CONFIRM_LOG_ODDS = 2.0  # lead of the tracked pose that confirms it
DECIDED_MASS = 0.99  # weight of the main cluster from which no other hypothesis is added to it
TRACKED_FRACTION = 0.3  # fraction of the particles that continue as they are when hypotheses get particles

_MIN_RELATIVE_WEIGHT = 1e-4  # hypotheses with less than this of the best one's likelihood get no particles
_PARTICLES_EACH = 50  # about a hypothesis that had none
_PARTICLE_STD = np.array([0.1, 0.1, 0.03])  # of the particles about a hypothesis: m, m, rad
_SAME_M, _SAME_RAD = 0.75, 0.4  # a hypothesis nearer than this to the tracked pose is the same place
_CLIMB_ROUNDS, _CLIMB_SHRINK = 4, 0.7
_CLIMB_STEP = (0.1, 0.02)  # m, rad
_TRACING_STEPS = ((0.1, 0.02), (0.05, 0.01))  # m, rad: steps by which a past pose is drawn to the map


@dataclass(frozen=True, slots=True)
class TrackedPose:
    """The particles, their main cluster, and the log-odds in its favour from before the window."""

    particles: Particles
    belief: Belief
    prior_log_odds: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """Result of a comparison: new particles, None if the tracked ones are kept; whether no hypothesis comes near them; and
    whether another one took over from the tracked pose.
    """

    particles: Particles | None
    is_confirmed: bool = False
    is_switch: bool = False


class Relocalizer:
    """Searches the map for the scans of a window, and compares the hypotheses with the tracked pose."""

    def __init__(
        self, search: PoseSearch, visibility: VisibilityField, by_cameras: CameraLogLikelihood
    ) -> None:
        self._search = search
        self._by_cameras = by_cameras  # log-likelihoods (n,) of poses (n, 3)
        self._visibility = visibility
        self._table = log_likelihood_table(visibility.field, MATCH_STD_M, RANDOM_WEIGHT)

    def search(self, beams: BeamSegments) -> PoseHypotheses:
        """Hypotheses about the robot's pose, best first; their scores are log-likelihoods of the beams."""
        coarse = self._search.search(beams.endpoints, self._table)
        scores = self._score(beams)(coarse.poses)
        first = np.argsort(-scores, kind="stable")[:FINALISTS]
        return self.refine(coarse.poses[first], beams)

    def refine(self, poses: Floats, beams: BeamSegments) -> PoseHypotheses:
        """The local maxima of the likelihood near the poses `(n, 3)`, one for each bin."""
        score = self._score(beams)
        scores = score(poses)
        step_m, step_rad = _CLIMB_STEP
        for _ in range(_CLIMB_ROUNDS):
            poses, scores = climb(score, poses, scores, step_m, step_rad)
            step_m, step_rad = _CLIMB_SHRINK * step_m, _CLIMB_SHRINK * step_rad
        return PoseHypotheses(*best_per_bin(poses, scores, BIN_M, BIN_RAD, len(poses)))

    def _score(self, beams: BeamSegments) -> LogLikelihood:
        return lambda poses: BEAM_WEIGHT * self._visibility.table_sums(self._table, beams, poses)

    def trace_back(self, poses: Floats, past: Sequence[PastScan]) -> Floats:
        """Log-likelihoods `(k, n)` of k past scans, latest first, for robots that are at poses `(n, 3)` now.

        Each pose is traced back along the odometry and drawn to the map at every scan: a hypothesis about the present must have
        been possible all along, to the map and to the fixed cameras. The log-odds of a single scan between two poses are bounded,
        because a place may have changed.
        """
        scores, by_cameras = np.zeros((2, len(past), len(poses)))
        for row, scan in enumerate(past):
            if len(scan.beams):
                score = self._score(scan.beams)
                scores[row] = score(poses)
                for step_m, step_rad in _TRACING_STEPS:
                    poses, scores[row] = climb(score, poses, scores[row], step_m, step_rad)
            if scan.observations:
                by_cameras[row] = self._by_cameras(scan.observations, poses)
            poses = se2.compose(poses, se2.inverse(scan.step))
        best = scores.max(axis=1, keepdims=True)
        return np.asarray(np.maximum(scores, best - MAX_SCAN_LOG_ODDS) + by_cameras)

    def compare(
        self, window: ScanWindow, tracked: TrackedPose | None, count: int, rng: np.random.Generator
    ) -> Comparison | None:
        """Compare the tracked particles with the hypotheses of a search; None if the window has too few beams.

        `count` is the number of new particles.
        """
        beams = window.recent(MAX_BEAMS)
        if len(beams) < MIN_BEAMS:
            return None
        found = self.search(beams)
        past = window.past(PAST_BEAMS)
        if tracked is None:
            seen = past[0].observations
            scored = PoseHypotheses(found.poses, found.scores + self._by_cameras(seen, found.poses))
            return Comparison(_sample(scored, count, rng), is_switch=True)
        own = self.refine(tracked.belief.mean[None], beams)
        others = _elsewhere(found.poses, own.poses[0])
        scores = self.trace_back(np.concatenate([own.poses[:1], others]), past)
        own_score = float(scores[:, 0].sum()) + tracked.prior_log_odds
        found = PoseHypotheses(others, with_kidnapping(scores[:, 1:], scores[:, 0], KIDNAPPING_LOG_ODDS))
        lead = own_score - found.scores.max(initial=-np.inf)
        if lead < -SWITCH_LOG_ODDS:
            particles = _mixture(tracked.particles, own_score, found, count, rng)
            return Comparison(particles, is_switch=True)
        is_confirmed = lead > CONFIRM_LOG_ODDS
        if tracked.belief.mass > DECIDED_MASS:
            return Comparison(None, is_confirmed)
        return Comparison(_with_overlooked(tracked, own_score, found, rng), is_confirmed)


def with_kidnapping(others: Floats, own: Floats, log_odds: float) -> Floats:
    """Scores `(n,)` of hypotheses over k scans `(k, n)`, latest first, that allow for the robot having been carried there.

    A hypothesis explains all scans itself. Or it explains only the latest ones, at the price of `log_odds`, and leaves the older
    ones to the tracked pose with the scores `own` `(k,)`.
    """
    latest = np.cumsum(others, axis=0)
    older = own.sum() - np.cumsum(own)
    carried = (latest + older[:, None])[:-1].max(axis=0, initial=-np.inf) - log_odds
    return np.asarray(np.maximum(latest[-1], carried))


def _elsewhere(poses: Floats, pose: Floats) -> Floats:
    """Those of the poses `(n, 3)` that are about another place than the pose `(3,)`."""
    off = poses - pose
    same = (np.hypot(off[:, 0], off[:, 1]) < _SAME_M) & (np.abs(se2.wrap_angle(off[:, 2])) < _SAME_RAD)
    return np.asarray(poses[~same])


def _with_overlooked(
    tracked: TrackedPose, own_score: float, found: PoseHypotheses, rng: np.random.Generator
) -> Particles | None:
    """The particles with new ones at the hypotheses that have none, weighted against the main cluster; None if all have some."""
    off = found.poses[:, None, :] - tracked.particles.poses
    is_near = np.hypot(off[..., 0], off[..., 1]) < _SAME_M
    is_near &= np.abs(se2.wrap_angle(off[..., 2])) < _SAME_RAD
    likely = found.scores > own_score + np.log(_MIN_RELATIVE_WEIGHT)
    new = likely & ~is_near.any(axis=1)
    if not new.any():
        return None
    overlooked = PoseHypotheses(found.poses[new], found.scores[new])
    weights = tracked.belief.mass * np.exp(overlooked.scores - own_score)
    added = _sample(overlooked, _PARTICLES_EACH * int(new.sum()), rng)
    poses = np.concatenate([tracked.particles.poses, added.poses])
    joined = np.r_[tracked.particles.weights, added.weights * weights.sum()]
    return Particles(poses, joined / joined.sum())


def _sample(found: PoseHypotheses, count: int, rng: np.random.Generator) -> Particles:
    """Particles about the hypotheses, their weights proportional to the likelihoods.

    The number of particles of a hypothesis is proportional to the root of its likelihood, so that unlikely ones have enough.
    """
    likelihoods = np.exp(found.scores - found.scores.max())
    kept = likelihoods >= _MIN_RELATIVE_WEIGHT
    poses, weights = found.poses[kept], likelihoods[kept] / likelihoods[kept].sum()
    chosen = systematic_resampling(np.sqrt(weights), count, rng)
    particles_each = np.bincount(chosen, minlength=len(poses))
    scattered = poses[chosen] + rng.standard_normal((count, 3)) * _PARTICLE_STD
    scattered[:, 2] = se2.wrap_angle(scattered[:, 2])
    split = weights[chosen] / particles_each[chosen]
    return Particles(scattered, split / split.sum())


def _mixture(
    particles: Particles, score: float, others: PoseHypotheses, count: int, rng: np.random.Generator
) -> Particles:
    """Some of the tracked particles with new ones about the hypotheses, weighted by the scores of both."""
    tracked_weight = float(1.0 / np.exp(np.r_[score, others.scores] - score).sum())
    kept = max(int(TRACKED_FRACTION * count), 1)
    chosen = systematic_resampling(particles.weights, kept, rng)
    new = _sample(others, count - kept, rng)
    poses = np.concatenate([particles.poses[chosen], new.poses])
    weights = np.r_[np.full(kept, tracked_weight / kept), new.weights * (1.0 - tracked_weight)]
    return Particles(poses, weights / weights.sum())
