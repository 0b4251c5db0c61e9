"""The tracked pose against everywhere else: hypotheses from a search of the map compete with the particles.

Augmented MCL draws random poses when the fit gets worse; in a building almost none of them is near the robot. Here the poses
come from the scans, and tracked and new ones are weighed by the same evidence, so that a filter that is right stays where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.particles import Belief, Particles
from gridslam.kernels.mcl import systematic
from gridslam.methods.ispace_mcl.config import SearchConfig
from gridslam.sensors.pose_search import Hypotheses, PoseSearch
from gridslam.sensors.likelihood_field import Table

Floats = NDArray[np.float64]

_LEAST_SHARE = 1e-4  # hypotheses less likely than this get no particles
_SCATTER = np.array([0.1, 0.1, 0.03])  # of the particles about a hypothesis: m, m, rad
_SURE = 0.95


@dataclass(frozen=True, slots=True)
class Contest:
    """What a search came to: the particles that go on, and whether the tracked pose has stood."""

    particles: Particles
    is_confirmed: bool


def compete(
    search: PoseSearch,
    points: Floats,
    table: Table,
    power: float,
    tracked: tuple[Particles, Belief] | None,
    most: int,
    config: SearchConfig,
    rng: np.random.Generator,
) -> Contest | None:
    """Search the map for the points and let the hypotheses compete with the tracked particles; None when nothing was found."""
    found = search.best(points, table)
    if not len(found.poses):
        return None
    if tracked is None:
        return Contest(_drawn(found, power, most, rng), False)
    particles, belief = tracked
    own = search.refine(belief.mean[None], points, table)
    rivals = _others(found, own.poses[0], config)
    scores = power * np.r_[own.scores[0], rivals.scores]
    shares = np.exp(scores - scores.max())
    shares /= shares.sum()
    if shares[0] >= _SURE:
        return Contest(particles, True)
    kept = max(int(config.tracked_share * most), 1)
    chosen = systematic(particles.weights, kept, float(rng.random()))
    new = _drawn(rivals, power, most - kept, rng)
    poses = np.concatenate([particles.poses[chosen], new.poses])
    weights = np.r_[np.full(kept, shares[0] / kept), new.weights * (1.0 - shares[0])]
    return Contest(Particles(poses, weights / weights.sum()), False)


def _others(found: Hypotheses, pose: Floats, config: SearchConfig) -> Hypotheses:
    """The hypotheses that are not about the same place."""
    off = found.poses - pose
    same = (np.hypot(off[:, 0], off[:, 1]) < 0.75) & (np.abs(se2.wrap_angle(off[:, 2])) < 0.4)
    return Hypotheses(found.poses[~same], found.scores[~same])


def _drawn(found: Hypotheses, power: float, count: int, rng: np.random.Generator) -> Particles:
    """Particles about the hypotheses: as many for each as the root of its share asks for, weighted so that the shares hold."""
    shares = np.exp(power * (found.scores - found.scores.max()))
    kept = shares >= _LEAST_SHARE
    poses, shares = found.poses[kept], shares[kept] / shares[kept].sum()
    root = np.sqrt(shares)
    members = systematic(root, count, float(rng.random()))
    drawn = np.bincount(members, minlength=len(poses))
    scattered = poses[members] + rng.standard_normal((count, 3)) * _SCATTER
    scattered[:, 2] = se2.wrap_angle(scattered[:, 2])
    weights = shares[members] / drawn[members]
    return Particles(scattered, weights / weights.sum())
