"""A finished map as what scans are matched against."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ir_scan.config import SearchMatching, ShiftMatching
from gridslam.methods.ir_scan.matching import Match, WallMatcher, match_by_shift
from gridslam.sensors.infrared import BeamEnds, RangeNoise

Floats = NDArray[np.float64]

_OCCUPIED_FROM = 0.65
_LINE_WINDOW_M, _LINE_CELLS = 0.12, 6.0
_FREE_POS = -0.25  # of certainly free cells; a wall has 1


class GivenShiftMap:
    """The paper's match on a map of probabilities: pos is 1 for walls, -0.25 for free cells, 0 where nothing is known."""

    def __init__(self, occupancy: OccupancyGrid, config: ShiftMatching) -> None:
        p = occupancy.probability.astype(np.float64)
        pos = np.where(p >= _OCCUPIED_FROM, 1.0, _FREE_POS * np.clip(1.0 - 2.0 * p, 0.0, 1.0))
        self._values: Floats = np.where(np.isnan(p), 0.0, pos)
        self._geometry, self._config = occupancy.geometry, config

    def match(self, ends: BeamEnds, prior: Floats, covariance: Floats) -> Match:
        """The best whole-cell shift."""
        return match_by_shift(self._values, self._geometry, ends, prior, covariance, self._config)


class GivenWallMap:
    """The search on a map's occupied cells, whose centres are points of walls."""

    def __init__(
        self, occupancy: OccupancyGrid, config: SearchMatching, noise: RangeNoise, memory_limit_mb: float
    ) -> None:
        resolution = occupancy.geometry.resolution_m
        window_m = config.line_window_m or max(_LINE_WINDOW_M, _LINE_CELLS * resolution)
        self._walls = WallMatcher(config, noise, resolution, window_m, memory_limit_mb)
        walls = np.argwhere(occupancy.probability >= _OCCUPIED_FROM)
        self._walls.add(occupancy.geometry.centres(walls), np.ones(len(walls)))

    def match(self, ends: BeamEnds, prior: Floats, covariance: Floats) -> Match:
        """Search and refine."""
        found = self._walls.match(ends, prior, covariance)
        return Match(prior, covariance, "no_match") if found.verdict == "first" else found
