"""A weighted set of poses and what it says: effective size, its main cluster, its spread."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Particles:
    """Poses `(n, 3)` with normalised weights `(n,)`."""

    poses: Floats
    weights: Floats

    def __len__(self) -> int:
        return len(self.poses)

    @staticmethod
    def even(poses: Floats) -> Particles:
        """All poses with the same weight."""
        return Particles(poses, np.full(len(poses), 1.0 / len(poses)))

    @property
    def effective_size(self) -> float:
        """N_eff = 1 / sum w^2."""
        return float(1.0 / np.sum(self.weights**2))

    def reweighted(self, log_likelihood: Floats) -> Particles:
        """Weights times likelihood, normalised."""
        weights = self.weights * np.exp(log_likelihood - log_likelihood.max())
        return Particles(self.poses, weights / weights.sum())


@dataclass(frozen=True, slots=True)
class Belief:
    """A Gaussian about part of the particles: mean `(3,)`, covariance `(3, 3)`, and the share of all weight that it stands for."""

    mean: Floats
    covariance: Floats
    mass: float

    @property
    def spread_m(self) -> float:
        """Standard deviation of the position."""
        return float(np.sqrt(max(self.covariance[0, 0] + self.covariance[1, 1], 0.0)))


def moments(particles: Particles) -> Belief:
    """Weighted mean (circular for yaw) and covariance of all particles."""
    return _moments(particles.poses, particles.weights)


def main_cluster(particles: Particles, radius_m: float, radius_rad: float, rounds: int = 4) -> Belief:
    """The heaviest cluster: the heaviest bin of the size of the radius, from which the mean climbs to the middle of what is about it.

    The mean of all particles would lie between clusters, in a wall.
    """
    poses, weights = particles.poses, particles.weights
    bins = np.floor(poses / (radius_m, radius_m, radius_rad)).astype(np.int64)
    bins -= bins.min(axis=0)
    extent = bins.max(axis=0) + 1
    _, member = np.unique((bins[:, 0] * extent[1] + bins[:, 1]) * extent[2] + bins[:, 2], return_inverse=True)
    near = member == np.argmax(np.bincount(member, weights))
    for _ in range(rounds):
        mean = _moments(poses[near], weights[near]).mean
        off = poses - mean
        inside = (off[:, 0] ** 2 + off[:, 1] ** 2 < radius_m**2) & (
            np.abs(se2.wrap_angle(off[:, 2])) < radius_rad
        )
        if not inside.any() or np.array_equal(inside, near):
            break
        near = inside
    return _moments(poses[near], weights[near])


def _moments(poses: Floats, weights: Floats) -> Belief:
    mass = float(weights.sum())
    share = weights / mass
    yaw = np.arctan2(share @ np.sin(poses[:, 2]), share @ np.cos(poses[:, 2]))
    mean = np.array([share @ poses[:, 0], share @ poses[:, 1], yaw])
    off = poses - mean
    off[:, 2] = se2.wrap_angle(off[:, 2])
    return Belief(mean, (off * share[:, None]).T @ off, mass)
