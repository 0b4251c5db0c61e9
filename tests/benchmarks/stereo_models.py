"""Maps of rays: stereo-bayes' own, and the log-odds of a plain inverse sensor model that it is held against."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import Rays

Floats = NDArray[np.float64]

LOG_ODDS = (0.85, -0.4)  # of a plain inverse sensor model: at the measured range, and before it
MOST_LOG_ODDS = 6.0
HALF_M = 12.0  # of the plain map
DISPARITIES_PX = 64.0
RAY_RAD = 0.02


class Model(Protocol):
    """A map that takes in frames of rays."""

    def take(self, rays: Rays, pose: Floats, covariance: Floats) -> None:
        """One frame from T_map_base `(3,)` with its covariance `(3, 3)`."""

    def layer(self) -> OccupancyGrid:
        """The probability of every cell."""


class Believed:
    """stereo-bayes."""

    def __init__(self, config: StereoBayesConfig) -> None:
        self.map = BeliefMap(config)

    def take(self, rays: Rays, pose: Floats, covariance: Floats) -> None:
        """One frame."""
        self.map.update(pose, covariance, rays, self.map.noise(DISPARITIES_PX))

    def layer(self) -> OccupancyGrid:
        """The probability of every cell, of those that were not seen as well."""
        layer = self.map.layer()
        return OccupancyGrid(np.asarray(layer.values, np.float32), layer.geometry)


class Plain:
    """Every cell before the measured range is freer, those at it are more occupied; one ray a cell, as in the method."""

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        size = 2 * round(HALF_M / config.resolution_m)
        self._log_odds = np.zeros((size, size))
        self._prior = float(np.log(config.prior / (1.0 - config.prior)))

    def take(self, rays: Rays, pose: Floats, covariance: Floats) -> None:
        """One frame; the pose is taken as it is."""
        cell = self._config.resolution_m
        c, s = np.cos(pose[2]), np.sin(pose[2])
        eye = pose[:2] + np.array([[c, -s], [s, c]]) @ rays.origin
        ranges = rays.focal_baseline / rays.disparities_px / np.cos(rays.bearings)
        ranges = np.where(np.isnan(ranges), self._config.max_range_m, ranges)
        row, col = np.indices(self._log_odds.shape)
        x, y = (col + 0.5) * cell - HALF_M - eye[0], (row + 0.5) * cell - HALF_M - eye[1]
        away = np.hypot(x, y)
        off = (np.arctan2(y, x) - pose[2] + np.pi) % (2.0 * np.pi) - np.pi
        k = np.clip(np.searchsorted(rays.bearings, off), 0, len(rays.bearings) - 1)
        inside = (np.abs(off - rays.bearings[k]) < RAY_RAD) & (away > self._config.min_range_m)
        at = inside & (np.abs(away - ranges[k]) <= 0.5 * cell) & ~np.isnan(rays.disparities_px)[k]
        before = inside & (away < np.minimum(ranges[k] - 0.5 * cell, self._config.max_range_m))
        told = self._log_odds + LOG_ODDS[0] * at + LOG_ODDS[1] * before
        self._log_odds = np.clip(told, -MOST_LOG_ODDS, MOST_LOG_ODDS)

    def layer(self) -> OccupancyGrid:
        """The probability of every cell."""
        p = 1.0 / (1.0 + np.exp(-(self._log_odds + self._prior)))
        return OccupancyGrid(
            p.astype(np.float32), GridGeometry(self._config.resolution_m, (-HALF_M, -HALF_M))
        )
