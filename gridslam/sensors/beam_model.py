"""Models that compare measured with expected ranges: the four-part beam mixture, and a plain Gaussian of the difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.beam import sum_over_beams
from gridslam.sensors.grid_frame import poses_in_cells
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.range_caster import RangeCaster

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class BeamMixture:
    """Weights of the four causes of a reading (any scale, not all of them 0), their shapes, and the bins of the table."""

    sigma_m: float
    hit: float
    short: float
    max: float
    random: float
    short_decay_per_m: float
    bin_m: float


def beam_table(model: BeamMixture, reach_m: float) -> NDArray[np.float32]:
    """Log-probability `(bins, bins)` of a measured (row) given an expected range (column); the last bin of each is the reach.

    Thrun et al. 2005, eqs. 6.4 - 6.12: Gaussian about the expected range and exponential before it, both normalised over
    their support; no return; uniform. Probabilities are per bin.
    """
    last = round(reach_m / model.bin_m)
    centres = np.arange(last + 1) * model.bin_m
    edges = np.r_[0.0, centres[:-1] + 0.5 * model.bin_m, reach_m]
    table = np.empty((last + 1, last + 1))
    for expected, z in enumerate(centres):
        cumulated = _normal(edges, z, model.sigma_m)
        hit = np.diff(cumulated) / max(float(cumulated[-1] - cumulated[0]), 1e-12)
        decay = 1.0 - np.exp(-model.short_decay_per_m * np.minimum(edges, z))
        short = np.diff(decay) / decay[-1] if decay[-1] > 0.0 else np.zeros(last + 1)
        table[:, expected] = model.hit * hit + model.short * short + model.random * np.diff(edges) / reach_m
    # Where no wall is within reach, no return is what is expected.
    table[:, last] = (
        model.short * np.diff(decay) / max(float(decay[-1]), 1e-12) + model.random * np.diff(edges) / reach_m
    )
    table[last, last] += model.hit
    table[last] += model.max
    table /= table.sum(axis=0)  # at an expected range of 0 nothing can be short of it
    return np.log(np.maximum(table, 1e-12)).astype(np.float32)


def _normal(edges: Floats, mean: float, sigma: float) -> Floats:
    """Cumulated normal distribution at the edges."""
    from scipy.special import ndtr

    return np.asarray(ndtr((edges - mean) / sigma))


class BeamModel:
    """The mixture on one map; its table is made when a sensor's reach is first seen."""

    def __init__(self, caster: RangeCaster, mixture: BeamMixture) -> None:
        self._caster = caster
        self._mixture = mixture
        self._tables: dict[float, NDArray[np.float32]] = {}

    def log_likelihood(self, beams: Beams, poses: Floats) -> Floats:
        """Sum over the beams of log p(z | pose, map) `(n,)` for robots at poses `(n, 3)`."""
        table = self._table(beams.reach_m)
        step = self._caster.geometry.resolution_m
        last = table.shape[0] - 1
        bins = np.minimum(np.rint(beams.ranges / self._mixture.bin_m).astype(np.int64), last - 1)
        bins[~beams.returned] = last
        return np.asarray(
            sum_over_beams(
                self._caster.squares,
                table,
                self._mixture.bin_m / step,
                beams.bearings,
                bins,
                beams.extrinsics / (step, step, 1.0),
                poses_in_cells(self._caster.geometry, poses),
                beams.reach_m / step,
            )
        )

    def _table(self, reach_m: float) -> NDArray[np.float32]:
        if reach_m not in self._tables:
            self._tables[reach_m] = np.ascontiguousarray(beam_table(self._mixture, reach_m))
        return self._tables[reach_m]


def range_difference_log_likelihood(
    caster: RangeCaster, beams: Beams, poses: Floats, sigma_m: float
) -> Floats:
    """-(1 / (2 sigma^2)) (1 / L) sum (z - zhat)^2 `(n,)` over L beams, both clipped at the reach (ispace-mcl, eqs. 3 and 4)."""
    expected = caster.ranges(poses, beams.bearings, beams.extrinsics, beams.reach_m)
    off = expected - beams.ranges.astype(np.float32)
    return np.asarray(-0.5 / sigma_m**2 * np.mean(off * off, axis=1, dtype=np.float64))
