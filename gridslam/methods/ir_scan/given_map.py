"""Matching against a finished map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ir_scan.shift_matching import ShiftSettings, match_by_shift
from gridslam.methods.ir_scan.stops import StopMatch
from gridslam.methods.ir_scan.wall_matching import SearchSettings, WallMatcher
from gridslam.sensors.infrared import RangeNoise, ReliableReadings

Floats = NDArray[np.float64]

MIN_OCCUPIED = 0.65  # smallest probability of an occupied cell
# Walls are fitted in windows of the larger of these two sizes
MIN_WINDOW_M, MIN_WINDOW_CELLS = 0.12, 6.0
FREE_POS = -0.25  # pos of a cell that is free with certainty; a wall has 1


class GivenShiftMap:
    """The paper's match on a map of probabilities: pos is 1 on walls, down to FREE_POS in free cells, and 0 in unknown ones."""

    def __init__(self, occupancy: OccupancyGrid, settings: ShiftSettings) -> None:
        p = occupancy.probability.astype(np.float64)
        pos = np.where(p >= MIN_OCCUPIED, 1.0, FREE_POS * np.clip(1.0 - 2.0 * p, 0.0, 1.0))
        self._values: Floats = np.where(np.isnan(p), 0.0, pos)
        self._geometry, self._settings = occupancy.geometry, settings

    def match(self, readings: ReliableReadings, prior: StopMatch) -> StopMatch:
        """The match of a scan by whole-cell shifts near the predicted pose `prior`."""
        return match_by_shift(self._values, self._geometry, readings, prior, self._settings)


class GivenWallMap:
    """The match by search; the centres of the map's occupied cells are points of walls."""

    def __init__(
        self, occupancy: OccupancyGrid, settings: SearchSettings, noise: RangeNoise, memory_limit_mb: float
    ) -> None:
        resolution = occupancy.geometry.resolution_m
        window_m = max(MIN_WINDOW_M, MIN_WINDOW_CELLS * resolution)
        self._walls = WallMatcher(
            settings, noise, resolution_m=resolution, window_m=window_m, memory_limit_mb=memory_limit_mb
        )
        walls = np.argwhere(occupancy.probability >= MIN_OCCUPIED)
        self._walls.add(occupancy.geometry.centres(walls), np.ones(len(walls)))

    def match(self, readings: ReliableReadings, prior: StopMatch) -> StopMatch:
        """The match of a scan by search and refinement near the predicted pose `prior`."""
        found = self._walls.match(readings, prior)
        return StopMatch(prior.pose, prior.covariance, "no_match") if found.verdict == "first" else found
