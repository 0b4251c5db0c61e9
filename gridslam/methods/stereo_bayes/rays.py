"""From a disparity image to one measurement per ray: the observation o of stereo-bayes, eq. 2."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import StereoHead
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.sensors.stereo_head import MATCHED, UNKNOWN, ColumnSettings, measured_columns

Floats = NDArray[np.float64]

BIN_PX = 4  # columns of pixels in a bin, each of which is one ray
# Bins with a smaller fraction of matched pixels give no evidence, not even of free space
MIN_MATCHED_RATIO = 0.25
# The depths of a ray's cells are computed at the mean of low_m and high_m, of which high_m is limited to this
MAX_HEIGHT_M = 1.0


@dataclass(frozen=True, slots=True)
class StereoRays:
    """The measurements of a frame that give evidence.

    bearings: Bearings of the rays in the robot's frame `(m,)` (rad), ascending.
    disparities_px: Disparities `(m,)`, NaN without a match.
    edges_m: Depths `(m, n + 1)` of the borders of the rays' n cells.
    origin: Position of the camera in the robot's frame `(2,)` (m).
    focal_baseline: Focal length times baseline (px m).
    """

    bearings: Floats
    disparities_px: Floats
    edges_m: Floats
    origin: Floats
    focal_baseline: float


def range_edges(config: StereoBayesConfig) -> Floats:
    """Horizontal ranges `(n + 1,)` (m) of the borders of a ray's n cells."""
    ranges = np.arange(config.min_range_m, config.max_range_m, config.resolution_m)
    return np.append(ranges, ranges[-1] + config.resolution_m)


class RayReader:
    """Removes floor and ceiling and selects one disparity for each bin of columns.

    Counters: rays.matched, rays.without_obstacle, and rays.unknown (bins without evidence, which give no ray).
    """

    def __init__(self, config: StereoBayesConfig, counters: Counter[str]) -> None:
        observation, advanced = config.observation, config.advanced.observation
        self._columns = ColumnSettings(
            bin_px=BIN_PX,
            low_m=observation.low_m,
            high_m=observation.high_m,
            min_height_m=advanced.min_height_m,
            min_matched_ratio=MIN_MATCHED_RATIO,
            take_nearest=advanced.pick == "nearest",
            max_disparity_px=float(config.disparity.disparities),
        )
        self._edges_m = range_edges(config)
        self._height_m = 0.5 * (max(observation.low_m, 0.0) + min(observation.high_m, MAX_HEIGHT_M))
        self._counters = counters

    def read(self, disparity_px: NDArray[np.float32], head: StereoHead) -> StereoRays:
        """The bins of a disparity image `(rows, cols)` that give evidence, sorted by bearing."""
        columns = measured_columns(disparity_px, head, self._columns)
        has_evidence = columns.status != UNKNOWN
        self._counters["rays.unknown"] += int((~has_evidence).sum())
        self._counters["rays.matched"] += int((columns.status == MATCHED).sum())
        self._counters["rays.without_obstacle"] += int((has_evidence & (columns.status != MATCHED)).sum())
        bearings = columns.bearings[has_evidence]
        order = np.argsort(bearings, kind="stable")
        bearings = np.ascontiguousarray(bearings[order])
        return StereoRays(
            bearings=bearings,
            disparities_px=columns.disparities_px[has_evidence][order],
            edges_m=head.depths(bearings, self._edges_m, self._height_m),
            origin=head.position[:2],
            focal_baseline=head.focal_px * head.baseline_m,
        )
