"""The map of probabilities, and what one frame does to it (stereo-bayes 2.3, 2.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.chain import expected_behind, likelihoods_of_rays
from gridslam.kernels.polar_window import priors_of_rays
from gridslam.kernels.stereo_update import tell_cells, told_across
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.rays import Rays, range_edges
from gridslam.methods.stereo_bayes.running_correlation import CorrelationEstimate
from gridslam.methods.stereo_bayes.seen import seen_cells
from gridslam.methods.stereo_bayes.window import Lattice, PolarValues, reach_in_cells, window
from gridslam.sensors.stereo_likelihood import StereoNoise, first_likelihoods

Floats = NDArray[np.float64]

_MARGIN = 2


class BeliefMap:
    """P(occupied) of every cell. A frame's rays are weighed against the map as it was before the frame.

    Every cell takes part with the one ray that leads through its centre, so that cells near the robot, which many rays cross, are
    not told the same thing many times.
    """

    def __init__(self, config: StereoBayesConfig) -> None:
        self._config = config
        # Log odds less those of the prior, and the probability that some ray has come to the cell.
        self._grid = GrowingGrid(config.resolution_m, config.memory_limit_mb, (2,))
        self._prior = float(np.log(config.prior / (1.0 - config.prior)))
        self._limit = float(np.log((1.0 - config.least_probability) / config.least_probability))
        self._count = len(range_edges(config)) - 1  # of a ray's cells
        self._eyes: list[Floats] = []  # where the rays came from, m
        self.correlation = CorrelationEstimate(config.correlation)

    def noise(self, disparity_range_px: float) -> StereoNoise:
        """The sensor's noise as the config has it."""
        observation = self._config.observation
        return StereoNoise(observation.sigma_px, observation.p_none, observation.p_false, disparity_range_px)

    def update(self, pose: Floats, covariance: Floats, rays: Rays, noise: StereoNoise) -> None:
        """Take in a frame's rays at T_map_base `(3,)` with covariance `(3, 3)`."""
        if not len(rays.bearings):
            return
        config, count = self._config, self._count
        spread = covariance if config.pose.blur else np.zeros((3, 3))
        eye = se2.transform_points(pose, rays.origin[None])[0]
        reach = config.resolution_m * reach_in_cells(self._lattice(eye), count, spread)
        self._grid.cover(np.array([eye - reach, eye + reach]), _MARGIN)
        # Cells that no ray meets have likelihoods of 1 either way: whatever is measured is as likely with them as without.
        rest = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
        polar = PolarValues(
            self._likelihoods(eye, float(pose[2]), rays, noise), rest, rays.bearings + float(pose[2])
        )
        (rows, cols), told = window(polar, self._lattice(eye), spread)
        tell_cells(
            self._grid.values[rows, cols],
            told,
            config.frame_weight,
            self._prior,
            self._limit,
            config.least_probability,
            config.correlation.behind == "once",
        )
        self._eyes.append(eye)
        if config.correlation.mode == "adaptive":
            self.correlation.learn(self.probability(), config.resolution_m)

    def probability(self) -> Floats:
        """P(occupied) `(rows, cols)` of all cells, the prior where nothing is known."""
        return np.asarray(1.0 / (1.0 + np.exp(-(self._grid.values[..., 0] + self._prior))))

    def occupancy(self) -> OccupancyGrid:
        """The map, NaN where nothing was seen.

        The chain knows more: behind an obstacle's surface there is likely more of it. That is in the layer, not in the map.
        """
        config, probability = self._config, self.probability()
        known = self._grid.values[..., 1] >= config.seen_from
        rows, cols = np.nonzero(known)
        if not len(rows):
            return OccupancyGrid(np.zeros((0, 0), np.float32), self._grid.geometry)
        known = seen_cells(
            probability,
            known,
            self._grid.cells(np.array(self._eyes)),
            config.min_range_m / config.resolution_m + _MARGIN,
            config.surface_m / config.resolution_m,
        )
        rows, cols = np.nonzero(known)
        low, high = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
        corner = self._grid.corner + low
        geometry = GridGeometry(
            config.resolution_m,
            (float(corner[1]) * config.resolution_m, float(corner[0]) * config.resolution_m),
        )
        values = np.where(known, probability, np.nan).astype(np.float32)
        return OccupancyGrid(values[low[0] : high[0], low[1] : high[1]], geometry)

    def layer(self) -> GridLayer:
        """The probabilities of all cells, the prior where nothing is known."""
        return GridLayer(self.probability().astype(np.float32), self._grid.geometry)

    def _likelihoods(self, eye: Floats, yaw: float, rays: Rays, noise: StereoNoise) -> Floats:
        """What a frame says of the cells of every ray `(5, m, n)`.

        P(o | E) / P(o), P(o | not E) / P(o), P(a ray comes there | o), the same a surface's thickness nearer, and P(E | o)
        if nothing was known behind obstacles.
        """
        config = self._config
        lattice = self._lattice(eye)
        prior, correlation = priors_of_rays(
            self._grid.values[..., 0],
            lattice.eye,
            rays.bearings + yaw,
            lattice.first + 0.5,
            self._count,
            self._prior,
            self.correlation.per_cell(config.resolution_m) if config.likelihood == "chain" else 0.0,
        )
        first, none = first_likelihoods(rays.disparities_px, rays.focal_baseline, rays.edges_m, noise)
        occupied, empty, reached = likelihoods_of_rays(
            prior, correlation, first, none, config.likelihood == "independent"
        )
        expected = expected_behind(reached, correlation, config.prior)
        if config.correlation.across_rays > 0.0:
            occupied, empty = told_across(
                occupied,
                empty,
                rays.bearings,
                np.asarray(lattice.first + 0.5 + np.arange(self._count), np.float64),
                self.correlation.per_cell(config.resolution_m),
                config.correlation.across_rays,
            )
        thick = min(round(config.correlation.behind_m / config.resolution_m), self._count)
        close = np.hstack([np.repeat(reached[:, :1], thick, axis=1), reached[:, : self._count - thick]])
        return np.stack([occupied, empty, reached, close, expected])

    def _lattice(self, eye: Floats) -> Lattice:
        """The grid's cells as rays from `eye` (m) meet them."""
        resolution = self._config.resolution_m
        return Lattice(
            eye / resolution - self._grid.corner[::-1], self._config.min_range_m / resolution, resolution
        )
