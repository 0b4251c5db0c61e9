"""The map of probabilities, and what one frame does to it (stereo-bayes 2.3, 2.4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.chain import expected_behind, likelihoods_of_rays
from gridslam.kernels.polar_window import priors_of_rays
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridGeometry, GridLayer, OccupancyGrid
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.correlation import CorrelationEstimate
from gridslam.methods.stereo_bayes.rays import Rays, range_edges
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
        self._tell(self._grid.values[rows, cols], *told)
        self._eyes.append(eye)
        if config.correlation.mode == "adaptive":
            self.correlation.learn(self.probability(), config.resolution_m)

    def _tell(
        self,
        values: Floats,
        if_occupied: Floats,
        if_empty: Floats,
        reached: Floats,
        close: Floats,
        expected: Floats,
    ) -> None:
        """Change the cells `(rows, cols, 2)` by what a frame says of them, each `(rows, cols)`.

        What the chain expects behind a surface follows from the surface: seeing that again and again makes it no surer. So what
        raises a cell beyond the expectation of this frame alone counts as far as a ray has come there.
        """
        told = self._config.frame_weight * np.log(if_occupied / if_empty)
        if self._config.correlation.behind == "once":
            p = np.clip(expected, self._config.least_probability, 1.0 - self._config.least_probability)
            room = np.log(p / (1.0 - p)) - self._prior - values[..., 0]
            at_once = np.clip(room, 0.0, np.maximum(told, 0.0))
            told = np.where(told > 0.0, at_once + close * (told - at_once), told)
        low, high = -self._limit - self._prior, self._limit - self._prior
        values[..., 0] = np.clip(values[..., 0] + told, low, high)
        values[..., 1] = np.maximum(values[..., 1], reached)

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
        """`(4, m, n)`, of the cells of every ray.

        P(o | E) / P(o), P(o | not E) / P(o), P(a ray comes there | o), and P(E | o) if nothing was known behind obstacles.
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
            occupied, empty = self._told_across(occupied, empty, rays.bearings)
        thick = min(round(config.correlation.behind_m / config.resolution_m), self._count)
        close = np.hstack([np.repeat(reached[:, :1], thick, axis=1), reached[:, : self._count - thick]])
        return np.stack([occupied, empty, reached, close, expected])

    def _told_across(self, occupied: Floats, empty: Floats, bearings: Floats) -> tuple[Floats, Floats]:
        """Every cell also hears what the neighbouring rays say, through its correlation with their cells at the same range.

        One round of messages between pairs: P(o' | E) = P(E'|E) P(o'|E') + P(not E'|E) P(o'|not E'), with prior 1/2.
        """
        share = self._config.correlation.across_rays
        edges = range_edges(self._config)
        middle = 0.5 * (edges[:-1] + edges[1:])
        gaps = np.abs(np.diff(bearings))
        distance = gaps[:, None] * middle[None] / self._config.resolution_m
        r = np.minimum(self.correlation.per_cell(self._config.resolution_m) ** distance, 0.999)
        same, other = 0.5 * (1.0 + r), 0.5 * (1.0 - r)
        told_occupied, told_empty = occupied.copy(), empty.copy()
        for to, source in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
            if_occupied = same * occupied[source] + other * empty[source]
            if_empty = other * occupied[source] + same * empty[source]
            told_occupied[to] *= if_occupied**share
            told_empty[to] *= if_empty**share
        return told_occupied, told_empty

    def _lattice(self, eye: Floats) -> Lattice:
        """The grid's cells as rays from `eye` (m) meet them."""
        resolution = self._config.resolution_m
        return Lattice(
            eye / resolution - self._grid.corner[::-1], self._config.min_range_m / resolution, resolution
        )
