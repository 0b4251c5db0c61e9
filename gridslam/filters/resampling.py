"""Systematic resampling, of all particles or by strata, to the number of particles that the belief needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.kld import particles_needed
from gridslam.filters.particles import Particles, bin_of
from gridslam.kernels.localization.mcl import occupied_bins, systematic

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class AdaptiveSize:
    """Parameters of KLD sampling: bounds of the number of particles, error, quantile, and bins of position and heading."""

    min: int
    max: int
    error: float
    quantile: float
    bin_m: float
    bin_rad: float


def systematic_resampling(weights: Floats, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices `(count,)` of the particles that survive, with one random number (low-variance resampling).

    `weights` `(n,)` need not be normalised; their sum must be positive. Source: Thrun et al. 2005, table 4.4.
    """
    return np.asarray(systematic(weights, count, float(rng.random())))


def resample(particles: Particles, size: AdaptiveSize, rng: np.random.Generator) -> Particles:
    """Particles with equal weights by systematic resampling; their number is that of KLD sampling."""
    return Particles.even(particles.poses.take(_drawn(particles.poses, particles.weights, size, rng), axis=0))


@dataclass(frozen=True, slots=True)
class Strata:
    """Particles `(n,)` by the stratum that each lies in, and the total weight of each stratum.

    Alike places are strata of their own, so that a place is not lost, nor favoured, because of the random numbers.
    """

    member: NDArray[np.int64]
    mass: Floats

    @staticmethod
    def of(particles: Particles, bin_m: float, bin_rad: float) -> Strata:
        """The strata of particles by bins of position and heading."""
        member = bin_of(particles.poses, bin_m, bin_rad)
        return Strata(member, np.asarray(np.bincount(member, particles.weights), np.float64))

    def flattened(self, weights: Floats) -> Floats:
        """Weights `(n,)` for drawing particles: the root of each stratum's weight is divided among its particles."""
        mass = self.mass[self.member]
        return np.divide(weights, np.sqrt(mass), out=np.zeros_like(weights), where=mass > 0.0)


def resample_strata(
    particles: Particles, strata: Strata, size: AdaptiveSize, rng: np.random.Generator
) -> Particles:
    """Particles by systematic resampling, as many of each stratum as the root of its weight says; each stratum keeps its weight.

    So unlikely strata have enough particles to be followed. One with too little weight for a single particle is dropped.
    """
    chosen = _drawn(particles.poses, strata.flattened(particles.weights), size, rng)
    member = strata.member[chosen]
    weights = (strata.mass / np.maximum(np.bincount(member, minlength=len(strata.mass)), 1))[member]
    return Particles(particles.poses[chosen], weights / weights.sum())


def _drawn(poses: Floats, weights: Floats, size: AdaptiveSize, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of the particles that systematic resampling draws, as many as KLD sampling needs.

    The occupied bins are counted over the largest number of particles, which errs on the side of more particles.
    """
    start = float(rng.random())
    chosen = systematic(weights, size.max, start)
    bins = occupied_bins(poses, chosen, size.bin_m, size.bin_rad)
    count = min(max(particles_needed(bins, size.error, size.quantile), size.min), size.max)
    return np.asarray(chosen if count == size.max else systematic(weights, count, start))
