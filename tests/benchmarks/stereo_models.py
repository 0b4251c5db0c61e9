"""Maps from rays: that of stereo-bayes, and the log-odds of a plain inverse sensor model for comparison."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import StereoRays

Floats = NDArray[np.float64]

LOG_ODDS = (0.85, -0.4)  # of a plain inverse sensor model: at the measured range, and before it
MAX_LOG_ODDS = 6.0
HALF_M = 12.0  # of the plain map
DISPARITIES_PX = 64.0
RAY_RAD = 0.02


class MapModel(Protocol):
    """A map that is updated by frames of rays."""

    def update(self, rays: StereoRays, pose: Floats, covariance: Floats) -> None:
        """Update by one frame at T_map_base `(3,)` with its covariance `(3, 3)`."""

    def layer(self) -> OccupancyGrid:
        """The probability of every cell."""


class BayesModel:
    """The map of stereo-bayes."""

    def __init__(self, config: StereoBayesConfig) -> None:
        self.map = BeliefMap(config)

    def update(self, rays: StereoRays, pose: Floats, covariance: Floats) -> None:
        """Update by one frame."""
        self.map.update(pose, covariance, rays, self.map.noise(DISPARITIES_PX))

    def layer(self) -> OccupancyGrid:
        """The probability of every cell, unknown ones included."""
        layer = self.map.layer()
        return OccupancyGrid(np.asarray(layer.values, np.float32), layer.geometry)


class InverseSensorModel:
    """Log-odds: cells before the measured range become freer, those at it more occupied; one ray per cell, as in the method."""

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        size = 2 * round(HALF_M / config.resolution_m)
        self._log_odds = np.zeros((size, size))
        self._prior = float(np.log(config.prior / (1.0 - config.prior)))

    def update(self, rays: StereoRays, pose: Floats, covariance: Floats) -> None:
        """Update by one frame; the covariance is not used."""
        cell = self._config.resolution_m
        c, s = np.cos(pose[2]), np.sin(pose[2])
        camera = pose[:2] + np.array([[c, -s], [s, c]]) @ rays.origin
        ranges = rays.focal_baseline / rays.disparities_px / np.cos(rays.bearings)
        ranges = np.where(np.isnan(ranges), self._config.max_range_m, ranges)
        row, col = np.indices(self._log_odds.shape)
        x, y = (col + 0.5) * cell - HALF_M - camera[0], (row + 0.5) * cell - HALF_M - camera[1]
        distance = np.hypot(x, y)
        offset = (np.arctan2(y, x) - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
        k = np.clip(np.searchsorted(rays.bearings, offset), 0, len(rays.bearings) - 1)
        inside = (np.abs(offset - rays.bearings[k]) < RAY_RAD) & (distance > self._config.min_range_m)
        at = inside & (np.abs(distance - ranges[k]) <= 0.5 * cell) & ~np.isnan(rays.disparities_px)[k]
        before = inside & (distance < np.minimum(ranges[k] - 0.5 * cell, self._config.max_range_m))
        updated = self._log_odds + LOG_ODDS[0] * at + LOG_ODDS[1] * before
        self._log_odds = np.clip(updated, -MAX_LOG_ODDS, MAX_LOG_ODDS)

    def layer(self) -> OccupancyGrid:
        """The probability of every cell."""
        p = 1.0 / (1.0 + np.exp(-(self._log_odds + self._prior)))
        return OccupancyGrid(
            p.astype(np.float32), GridGeometry(self._config.resolution_m, (-HALF_M, -HALF_M))
        )
