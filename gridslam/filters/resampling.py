"""Resampling with as many particles as the belief needs."""

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
    """Number of particles by KLD sampling, between two bounds; bins of `bin_m` by `bin_m` by `bin_rad`."""

    least: int
    most: int
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
    """Systematic (low-variance) resampling to evenly weighted particles, as many as KLD sampling asks for.

    The bins are counted over the most that could be drawn, which errs to the side of more particles.
    """
    start = float(rng.random())
    chosen = systematic(particles.weights, size.most, start)
    bins = occupied_bins(particles.poses, chosen, size.bin_m, size.bin_rad)
    count = min(max(particles_needed(bins, size.error, size.quantile), size.least), size.most)
    if count < size.most:
        chosen = systematic(particles.weights, count, start)
    return Particles.even(particles.poses[chosen])
