"""Particles about the hypotheses of a search: alone, beside some of the tracked ones, or added to all of them."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.filters.particles import Particles
from gridslam.filters.resampling import systematic_resampling
from gridslam.sensors.pose_search import PoseHypotheses

TRACKED_FRACTION = 0.3  # fraction of the particles that continue as they are when hypotheses get particles

# Weight of all overlooked hypotheses over that of the tracked pose: new scans decide between them
MAX_OVERLOOKED = 0.5
_MIN_RELATIVE_WEIGHT = 1e-4  # hypotheses with less than this of the best one's likelihood get no particles
_PARTICLES_EACH = 50  # number of particles about a hypothesis that had none
# Standard deviations of the particles about a hypothesis: m, m, rad
_PARTICLE_STD = np.array([0.1, 0.1, 0.03])


def with_overlooked(
    particles: Particles, score: float, mass: float, overlooked: PoseHypotheses, rng: np.random.Generator
) -> Particles | None:
    """The particles with new ones at the overlooked hypotheses; None if all of these are unlikely.

    The hypotheses are weighted against the main cluster, which has the score `score` and the weight `mass`.
    """
    likely = overlooked.scores > score + np.log(_MIN_RELATIVE_WEIGHT)
    if not likely.any():
        return None
    new = PoseHypotheses(overlooked.poses[likely], overlooked.scores[likely])
    weight = mass * min(float(np.exp(new.scores - score).sum()), MAX_OVERLOOKED)
    added = sample_hypotheses(new, _PARTICLES_EACH * len(new.poses), rng)
    poses = np.concatenate([particles.poses, added.poses])
    joined = np.r_[particles.weights, added.weights * weight]
    return Particles(poses, joined / joined.sum())


def sample_hypotheses(found: PoseHypotheses, count: int, rng: np.random.Generator) -> Particles:
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


def mixture(
    particles: Particles, score: float, others: PoseHypotheses, count: int, rng: np.random.Generator
) -> Particles:
    """Some of the tracked particles with new ones about the hypotheses, weighted by the scores of both."""
    tracked_weight = float(1.0 / np.exp(np.r_[score, others.scores] - score).sum())
    kept = max(int(TRACKED_FRACTION * count), 1)
    chosen = systematic_resampling(particles.weights, kept, rng)
    new = sample_hypotheses(others, count - kept, rng)
    poses = np.concatenate([particles.poses[chosen], new.poses])
    weights = np.r_[np.full(kept, tracked_weight / kept), new.weights * (1.0 - tracked_weight)]
    return Particles(poses, weights / weights.sum())
