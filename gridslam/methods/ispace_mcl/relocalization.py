"""The tracked pose against everywhere else: hypotheses from a search of the map compete with the particles.

Augmented MCL draws random poses when the fit gets worse; in a building almost none of them is near the robot. Here the poses
come from the scans, and tracked and new ones are weighed by the same evidence, so that a filter that is right stays where it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.particles import Belief, Particles
from gridslam.filters.resampling import systematic_resampling
from gridslam.methods.ispace_mcl.config import SearchConfig
from gridslam.methods.ispace_mcl.window import PastScan, ScanWindow
from gridslam.sensors.likelihood_field import log_likelihood_table
from gridslam.sensors.pose_search import Hypotheses, PoseSearch, best_apart, climb
from gridslam.sensors.sight import Segments, Sight

Floats = NDArray[np.float64]

_LEAST_SHARE = 1e-4  # hypotheses less likely than this get no particles
_SCATTER = np.array([0.1, 0.1, 0.03])  # of the particles about a hypothesis: m, m, rad
_APART = (0.5, 0.26)  # m, rad: one hypothesis per place
_LEAST_POINTS = 10
_TRACING_STEPS = ((0.1, 0.02), (0.05, 0.01))  # m, rad: how far a pose is drawn to the map at each scan


@dataclass(frozen=True, slots=True)
class Tracked:
    """The particles as they are, their main cluster, and what it has earned before the window, in log-odds."""

    particles: Particles
    belief: Belief
    trust: float


@dataclass(frozen=True, slots=True)
class Contest:
    """What a search came to: other particles, None where the tracked ones stay; and whether nothing comes near to them."""

    particles: Particles | None
    is_confirmed: bool


class Contender:
    """Searches the map for a window of scans, and weighs what it finds by lines of sight."""

    def __init__(self, search: PoseSearch, sight: Sight, config: SearchConfig) -> None:
        self._search = search
        self._sight = sight
        self._config = config
        self._table = log_likelihood_table(sight.field, config.match_sigma_m, config.random_share)

    def found(self, segments: Segments) -> Hypotheses:
        """Hypotheses about the robot's pose, best first; their scores are log-likelihoods of the window."""
        coarse = self._search.best(segments.ends, self._table)
        scores = self._score(segments)(coarse.poses)
        first = np.argsort(-scores, kind="stable")[: self._config.finalists]
        return self.climbed(coarse.poses[first], segments)

    def climbed(self, poses: Floats, segments: Segments) -> Hypotheses:
        """The best poses near the given ones, one for each place."""
        score = self._score(segments)
        scores = score(poses)
        in_xy, in_yaw = 0.1, 0.02
        for _ in range(4):
            poses, scores = climb(score, poses, scores, in_xy, in_yaw)
            in_xy, in_yaw = 0.7 * in_xy, 0.7 * in_yaw
        return Hypotheses(*best_apart(poses, scores, *_APART, len(poses)))

    def _score(self, segments: Segments) -> Callable[[Floats], Floats]:
        return lambda poses: self._config.beam_weight * self._sight.sums(self._table, segments, poses)

    def traced(self, poses: Floats, past: Sequence[PastScan]) -> Floats:
        """Log-likelihoods `(k, n)` of k scans, latest first, for robots that are at poses `(n, 3)` now.

        Each pose is followed back along the way, drawn to the map at every scan: what a hypothesis says about now must have
        been possible all the time. What one scan can say for one pose and against another
        is bounded: a place may have changed.
        """
        scores = np.zeros((len(past), len(poses)))
        for row, scan in enumerate(past):
            if len(scan.segments):
                score = self._score(scan.segments)
                scores[row] = score(poses)
                for in_xy, in_yaw in _TRACING_STEPS:
                    poses, scores[row] = climb(score, poses, scores[row], in_xy, in_yaw)
            poses = se2.compose(poses, se2.inverse(scan.step))
        best = scores.max(axis=1, keepdims=True)
        return np.asarray(np.maximum(scores, best - self._config.most_evidence))

    def contest(
        self,
        window: ScanWindow,
        tracked: Tracked | None,
        most: int,
        rng: np.random.Generator,
        others_say: Callable[[Floats], Floats],
    ) -> Contest | None:
        """The tracked particles against what the search finds; None when there is too little to search for.

        `others_say` gives the log-likelihoods `(n,)` of poses `(n, 3)` by what is known besides the scans.
        """
        config = self._config
        segments = window.recent(config.window_points)
        if len(segments) < _LEAST_POINTS:
            return None
        found = self.found(segments)
        if tracked is None:
            said = Hypotheses(found.poses, found.scores + others_say(found.poses))
            return Contest(_drawn(said, most, rng), False)
        own = self.climbed(tracked.belief.mean[None], segments)
        rivals = _others(found, own.poses[0])
        past = window.past(config.past_beams)
        traced = self.traced(np.concatenate([own.poses[:1], rivals.poses]), past)
        own_score = float(traced[:, 0].sum() + others_say(own.poses[:1])[0]) + tracked.trust
        scores = with_break(traced[:, 1:], traced[:, 0], config.carried_odds)
        rivals = Hypotheses(rivals.poses, scores + others_say(rivals.poses))
        lead = own_score - rivals.scores.max(initial=-np.inf)
        if lead > -config.rival_lead:
            return Contest(None, lead > config.sure_lead)
        return Contest(self._mixed(tracked.particles, own_score, rivals, most, rng), False)

    def _mixed(
        self, particles: Particles, score: float, rivals: Hypotheses, most: int, rng: np.random.Generator
    ) -> Particles:
        """The tracked particles and particles about the rivals, weighted by what speaks for each."""
        share = float(1.0 / np.exp(np.r_[score, rivals.scores] - score).sum())
        kept = max(int(self._config.tracked_share * most), 1)
        chosen = systematic_resampling(particles.weights, kept, rng)
        new = _drawn(rivals, most - kept, rng)
        poses = np.concatenate([particles.poses[chosen], new.poses])
        weights = np.r_[np.full(kept, share / kept), new.weights * (1.0 - share)]
        return Particles(poses, weights / weights.sum())


def with_break(rivals: Floats, own: Floats, odds: float) -> Floats:
    """Scores `(n,)` of rivals over k scans `(k, n)`, latest first, that may claim to have been carried there.

    A rival explains all scans itself; or, at the price of `odds`, only the latest ones, and leaves the older ones to the tracked
    pose's scores `(k,)`.
    """
    latest = np.cumsum(rivals, axis=0)
    older = own.sum() - np.cumsum(own)
    carried = (latest + older[:, None])[:-1].max(axis=0, initial=-np.inf) - odds
    return np.asarray(np.maximum(latest[-1], carried))


def _others(found: Hypotheses, pose: Floats) -> Hypotheses:
    """The hypotheses that are not about the same place."""
    off = found.poses - pose
    same = (np.hypot(off[:, 0], off[:, 1]) < 0.75) & (np.abs(se2.wrap_angle(off[:, 2])) < 0.4)
    return Hypotheses(found.poses[~same], found.scores[~same])


def _drawn(found: Hypotheses, count: int, rng: np.random.Generator) -> Particles:
    """Particles about the hypotheses: as many for each as the root of its share asks for, weighted so that the shares hold."""
    shares = np.exp(found.scores - found.scores.max())
    kept = shares >= _LEAST_SHARE
    poses, shares = found.poses[kept], shares[kept] / shares[kept].sum()
    root = np.sqrt(shares)
    members = systematic_resampling(root, count, rng)
    drawn = np.bincount(members, minlength=len(poses))
    scattered = poses[members] + rng.standard_normal((count, 3)) * _SCATTER
    scattered[:, 2] = se2.wrap_angle(scattered[:, 2])
    weights = shares[members] / drawn[members]
    return Particles(scattered, weights / weights.sum())
