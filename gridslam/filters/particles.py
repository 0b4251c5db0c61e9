"""Weighted particles, their effective sample size, moments and main cluster."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

_MAX_DIRECT_BINS = 1e6  # up to this many bins are counted directly; otherwise only occupied bins are numbered


@dataclass(frozen=True, slots=True)
class Particles:
    """Poses `(n, 3)` (x, y, yaw) with normalised weights `(n,)`."""

    poses: Floats
    weights: Floats

    def __len__(self) -> int:
        return len(self.poses)

    @staticmethod
    def even(poses: Floats) -> Particles:
        """Particles at the poses `(n, 3)` with equal weights."""
        return Particles(poses, np.full(len(poses), 1.0 / len(poses)))

    @property
    def effective_size(self) -> float:
        """Effective sample size N_eff = 1 / sum w^2."""
        return float(1.0 / np.sum(self.weights**2))

    def reweighted(self, log_likelihood: Floats) -> Particles:
        """The particles with their weights multiplied by a likelihood `(n,)` and normalised."""
        with np.errstate(divide="ignore"):
            log_weights = np.log(self.weights) + log_likelihood
        weights = np.exp(log_weights - log_weights.max())
        return Particles(self.poses, weights / weights.sum())


@dataclass(frozen=True, slots=True)
class Belief:
    """A Gaussian of some of the particles: mean `(3,)`, covariance `(3, 3)`, and their total weight `mass`."""

    mean: Floats
    covariance: Floats
    mass: float

    @property
    def std_m(self) -> float:
        """Standard deviation of the position, m: the root of var_x + var_y."""
        return float(np.sqrt(max(self.covariance[0, 0] + self.covariance[1, 1], 0.0)))


def moments(particles: Particles) -> Belief:
    """Weighted mean (circular for yaw) and covariance of all particles."""
    return _moments(particles.poses, particles.weights)


def main_cluster(particles: Particles, radius_m: float, radius_rad: float, rounds: int = 4) -> Belief:
    """The heaviest cluster of particles, by mean shift from the heaviest bin of the size of the radius.

    The mean of all particles would lie between clusters, perhaps in a wall.
    """
    poses, weights = particles.poses, particles.weights
    member = bin_of(poses, radius_m, radius_rad)
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


def bin_of(poses: Floats, bin_m: float, bin_rad: float) -> NDArray[np.int64]:
    """Number `(n,)` of each pose's bin of position and heading."""
    bins = np.floor(poses / (bin_m, bin_m, bin_rad)).astype(np.int64)
    bins -= bins.min(axis=0)
    extent = bins.max(axis=0) + 1
    member = (bins[:, 0] * extent[1] + bins[:, 1]) * extent[2] + bins[:, 2]
    if np.prod(extent, dtype=np.float64) > _MAX_DIRECT_BINS:
        _, member = np.unique(member, return_inverse=True)
    return np.asarray(member)


def _moments(poses: Floats, weights: Floats) -> Belief:
    mass = float(weights.sum())
    normalised = weights / mass
    # Sums, not products of matrices: the order in which a BLAS adds depends on the CPU.
    sin, cos = (float(np.sum(normalised * part(poses[:, 2]))) for part in (np.sin, np.cos))
    x, y = np.sum(normalised[:, None] * poses[:, :2], axis=0)
    mean = np.array([x, y, np.arctan2(sin, cos)])
    off = poses - mean
    off[:, 2] = se2.wrap_angle(off[:, 2])
    covariance = np.sum((off * normalised[:, None])[:, :, None] * off[:, None, :], axis=0)
    return Belief(mean, covariance, mass)
