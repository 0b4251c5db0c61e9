"""Systematic resampling, and resampling to the number of particles that the belief needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.kld import particles_needed
from gridslam.filters.particles import Particles
from gridslam.kernels.mcl import occupied_bins, systematic

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
    """Particles with equal weights by systematic resampling; their number is that of KLD sampling.

    The occupied bins are counted over the largest number of particles, which errs on the side of more particles.
    """
    start = float(rng.random())
    chosen = systematic(particles.weights, size.max, start)
    bins = occupied_bins(particles.poses, chosen, size.bin_m, size.bin_rad)
    count = min(max(particles_needed(bins, size.error, size.quantile), size.min), size.max)
    if count < size.max:
        chosen = systematic(particles.weights, count, start)
    return Particles.even(particles.poses[chosen])
