"""From a disparity image to one measurement per ray: the observation o of stereo-bayes' eq. 2."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.sensors.stereo_head import MATCHED, UNKNOWN, ColumnSettings, measured_columns

Floats = NDArray[np.float64]

_TALLEST_M = 1.0  # of the middle height at which a ray's cells are placed


@dataclass(frozen=True, slots=True)
class Rays:
    """The measurements of a frame that tell something.

    Directions in the robot's frame `(m,)`, ascending, disparities `(m,)` (NaN: no match), depth edges `(m, n + 1)` of the rays'
    cells, and T_base_camera's place over the ground `(2,)`.
    """

    bearings: Floats
    disparities_px: Floats
    edges_m: Floats
    origin: Floats
    focal_baseline: float


def range_edges(config: StereoBayesConfig) -> Floats:
    """Ground ranges `(n + 1,)` between the cells of a ray, m."""
    ranges = np.arange(config.min_range_m, config.max_range_m, config.resolution_m)
    return np.append(ranges, ranges[-1] + config.resolution_m)


class RayReader:
    """Cuts floor and ceiling off, and takes of every bin of columns the disparity that counts.

    Counters: rays.matched, rays.without_obstacle, and rays.unknown, which are left out.
    """

    def __init__(self, config: StereoBayesConfig, counters: Counter[str]) -> None:
        o = config.observation
        self._columns = ColumnSettings(
            o.bin_px,
            o.low_m,
            o.high_m,
            o.least_height_m,
            o.least_share,
            o.pick == "nearest",
            float(config.disparity.disparities),
        )
        self._edges_m = range_edges(config)
        self._height_m = 0.5 * (max(o.low_m, 0.0) + min(o.high_m, _TALLEST_M))
        self._counters = counters

    def read(self, disparity_px: NDArray[np.float32], head: StereoHead) -> Rays:
        """The bins of a disparity image `(rows, cols)` that tell something, in the order of their directions."""
        columns = measured_columns(disparity_px, head, self._columns)
        told = columns.status != UNKNOWN
        self._counters["rays.unknown"] += int((~told).sum())
        self._counters["rays.matched"] += int((columns.status == MATCHED).sum())
        self._counters["rays.without_obstacle"] += int((told & (columns.status != MATCHED)).sum())
        bearings = columns.bearings[told]
        order = np.argsort(bearings, kind="stable")
        bearings = np.ascontiguousarray(bearings[order])
        edges = head.depths(bearings, self._edges_m, self._height_m)
        focal_baseline = head.focal_px * head.baseline_m
        return Rays(bearings, columns.disparities_px[told][order], edges, head.position[:2], focal_baseline)
