"""Models of measured against expected ranges: the four-part beam mixture, and a Gaussian of the mean squared difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.localization.beam import MeasuredBeams, RangeTable, sum_over_ranges
from gridslam.sensors.grid_frame import poses_in_cells
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.range_caster import RangeCaster

Floats = NDArray[np.float64]

_MIN_PROBABILITY = 1e-12  # keeps logarithms and quotients finite


@dataclass(frozen=True, slots=True)
class BeamMixture:
    """The beam model of Thrun et al. 2005, table 6.1: weights of the four causes of a reading, and their shapes.

    `hit` weights the wall, `short` an object before it, `max` no return and `random` anything else; weights may have any scale,
    but not all be 0. `sigma_m` is the standard deviation of a range, `short_decay_per_m` the decay of short readings with range,
    `bin_m` the bin of the tabulated model.
    """

    sigma_m: float
    hit: float
    short: float
    max: float
    random: float
    short_decay_per_m: float
    bin_m: float


def beam_table(model: BeamMixture, max_range_m: float) -> NDArray[np.float32]:
    """Log-probabilities `(bins, bins)` of measured ranges (row) given expected ranges (column); the last bin of each is no
    return.

    Probabilities are per bin. Source: Thrun et al. 2005, eqs. 6.4 - 6.12: a Gaussian about the expected range and an exponential
    before it, both normalised over their support; no return; uniform.
    """
    last = round(max_range_m / model.bin_m)
    centres = np.arange(last + 1) * model.bin_m
    edges = np.r_[0.0, centres[:-1] + 0.5 * model.bin_m, max_range_m]
    table = np.empty((last + 1, last + 1))
    for expected, z in enumerate(centres):
        cumulative = _normal(edges, z, model.sigma_m)
        hit = np.diff(cumulative) / max(float(cumulative[-1] - cumulative[0]), _MIN_PROBABILITY)
        decay = 1.0 - np.exp(-model.short_decay_per_m * np.minimum(edges, z))
        short = np.diff(decay) / decay[-1] if decay[-1] > 0.0 else np.zeros(last + 1)
        table[:, expected] = (
            model.hit * hit + model.short * short + model.random * np.diff(edges) / max_range_m
        )
    # Without a wall within range, no return is the expected reading.
    table[:, last] = (
        model.short * np.diff(decay) / max(float(decay[-1]), _MIN_PROBABILITY)
        + model.random * np.diff(edges) / max_range_m
    )
    table[last, last] += model.hit
    table[last] += model.max
    table /= table.sum(axis=0)  # at an expected range of 0 no reading can be shorter
    return np.log(np.maximum(table, _MIN_PROBABILITY)).astype(np.float32)


def _normal(edges: Floats, mean: float, sigma: float) -> Floats:
    """Cumulative normal distribution at the edges."""
    from scipy.special import ndtr

    return np.asarray(ndtr((edges - mean) / sigma))


class BeamModel:
    """The mixture on one map; a table is computed for each maximum range that occurs."""

    def __init__(self, caster: RangeCaster, mixture: BeamMixture) -> None:
        self._caster = caster
        self._mixture = mixture
        self._tables: dict[float, NDArray[np.float32]] = {}

    def log_likelihood(self, beams: Beams, poses: Floats) -> Floats:
        """Sums `(n,)` over the beams of log p(z | pose, map) for robot poses `(n, 3)` in the map frame."""
        table = self._table(beams.max_range_m)
        cell_m = self._caster.geometry.resolution_m
        last = table.shape[0] - 1
        bins = np.minimum(np.rint(beams.ranges / self._mixture.bin_m).astype(np.int64), last - 1)
        bins[~beams.returned] = last
        return np.asarray(
            sum_over_ranges(
                self._caster.boxes,
                RangeTable(table, self._mixture.bin_m / cell_m),
                MeasuredBeams(
                    beams.bearings,
                    bins,
                    beams.extrinsics / (cell_m, cell_m, 1.0),
                    beams.max_range_m / cell_m,
                ),
                poses_in_cells(self._caster.geometry, poses),
            )
        )

    def _table(self, max_range_m: float) -> NDArray[np.float32]:
        if max_range_m not in self._tables:
            self._tables[max_range_m] = np.ascontiguousarray(beam_table(self._mixture, max_range_m))
        return self._tables[max_range_m]


def range_difference_log_likelihood(
    caster: RangeCaster, beams: Beams, poses: Floats, sigma_m: float
) -> Floats:
    """-(1 / (2 sigma^2)) (1 / L) sum (z - zhat)^2 `(n,)` over L beams for robot poses `(n, 3)` (ispace-mcl, eqs. 3 and 4).

    Measured ranges z and expected ranges zhat are at most the maximum range.
    """
    expected = caster.ranges(poses, beams.bearings, beams.extrinsics, beams.max_range_m)
    off = expected - beams.ranges.astype(np.float32)
    return np.asarray(-0.5 / sigma_m**2 * np.mean(off * off, axis=1, dtype=np.float64))
