"""The map of probabilities, and what one frame does to it (stereo-bayes 2.3, 2.4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.chain import likelihoods_of_rays
from gridslam.kernels.polar_window import window_of_rays
from gridslam.maps.growing_grid import GrowingGrid
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.correlation import CorrelationEstimate
from gridslam.sensors.stereo_likelihood import StereoNoise, first_likelihoods

Floats = NDArray[np.float64]

_TURNS = 5  # of the pose's distribution over the heading
_LEAST_BLUR = 0.3  # cells: less than this does nothing
_MARGIN = 2
_REACH_IN_GAPS = 0.75  # of neighbouring rays: cells farther from every ray are between bins that told nothing
_LONE_RAY_RAD = 0.005


@dataclass(frozen=True, slots=True)
class Rays:
    """The measurements of a frame that tell something: directions in the robot's frame `(m,)`, ascending, disparities `(m,)`
    (NaN: no match), depth edges `(m, n + 1)` of their cells, and T_base_camera's place over the ground `(2,)`.
    """

    bearings: Floats
    disparities_px: Floats
    edges_m: Floats
    origin: Floats
    focal_baseline: float


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
        self._ranges = np.arange(config.min_range_m, config.max_range_m, config.resolution_m)
        self.correlation = CorrelationEstimate(config.correlation)

    @property
    def edges_m(self) -> Floats:
        """Ground ranges `(n + 1,)` between the cells of a ray."""
        return np.append(self._ranges, self._ranges[-1] + self._config.resolution_m)

    def noise(self, disparity_range_px: float) -> StereoNoise:
        """The sensor's noise as the config has it."""
        observation = self._config.observation
        return StereoNoise(observation.sigma_px, observation.p_none, observation.p_false, disparity_range_px)

    def update(self, pose: Floats, covariance: Floats, rays: Rays, noise: StereoNoise) -> None:
        """Take in a frame's rays at T_map_base `(3,)` with covariance `(3, 3)`."""
        if not len(rays.bearings):
            return
        eye = se2.transform_points(pose, rays.origin[None])[0]
        reach = self._ranges[-1] + self._config.resolution_m
        self._grid.cover(np.array([eye - reach, eye + reach]), _MARGIN)
        occupied, empty, reached = self._likelihoods(eye, float(pose[2]), rays, noise)
        if self._config.correlation.across_rays > 0.0:
            occupied, empty = self._told_across(occupied, empty, rays.bearings)
        polar = np.stack([occupied, empty, reached])
        (rows, cols), (ratio, seen) = self._as_window(eye, pose, covariance, rays.bearings, polar)
        limit = self._limit
        values = self._grid.values[rows, cols]
        values[..., 0] = np.clip(
            values[..., 0] + self._config.frame_weight * ratio, -limit - self._prior, limit - self._prior
        )
        values[..., 1] = np.maximum(values[..., 1], seen)
        if self._config.correlation.mode == "adaptive":
            self.correlation.learn(self.probability(), self._config.resolution_m)

    def probability(self) -> Floats:
        """P(occupied) `(rows, cols)` of all cells, the prior where nothing is known."""
        return np.asarray(1.0 / (1.0 + np.exp(-(self._grid.values[..., 0] + self._prior))))

    def occupancy(self) -> OccupancyGrid:
        """The map, NaN where no ray has come to.

        The chain knows more: behind an obstacle's surface there is likely more of it. That is in the layer, not in the map.
        """
        probability = self.probability()
        known = self._grid.values[..., 1] >= self._config.seen_from
        values = np.where(known, probability, np.nan).astype(np.float32)
        rows, cols = np.nonzero(known)
        if not len(rows):
            return OccupancyGrid(np.zeros((0, 0), np.float32), self._grid.geometry)
        low, high = (rows.min(), cols.min()), (rows.max() + 1, cols.max() + 1)
        corner = self._grid.corner + low
        geometry = type(self._grid.geometry)(
            self._config.resolution_m,
            (float(corner[1]) * self._config.resolution_m, float(corner[0]) * self._config.resolution_m),
        )
        return OccupancyGrid(values[low[0] : high[0], low[1] : high[1]], geometry)

    def layer(self) -> GridLayer:
        """The probabilities of all cells, the prior where nothing is known."""
        return GridLayer(self.probability().astype(np.float32), self._grid.geometry)

    def _likelihoods(
        self, eye: Floats, yaw: float, rays: Rays, noise: StereoNoise
    ) -> tuple[Floats, Floats, Floats]:
        """P(o | E) / P(o), P(o | not E) / P(o), and P(a ray comes there | o) `(m, n)` of the cells of every ray."""
        config = self._config
        angle = rays.bearings + yaw
        middle = self._ranges + 0.5 * config.resolution_m
        points = eye + middle[None, :, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)[:, None, :]
        cells = self._grid.cells(points.reshape(-1, 2)).reshape(*points.shape)
        log_odds = self._grid.values[cells[..., 0], cells[..., 1], 0] + self._prior
        prior = 1.0 / (1.0 + np.exp(-log_odds))
        if config.likelihood == "chain":
            step = np.zeros(prior.shape)
            step[:, 1:] = np.hypot(*np.moveaxis(np.diff(cells, axis=1), 2, 0))
            correlation = self.correlation.per_cell(config.resolution_m) ** step
        else:
            correlation = np.zeros(prior.shape)
        first, none = first_likelihoods(rays.disparities_px, rays.focal_baseline, rays.edges_m, noise)
        occupied, empty, reached = likelihoods_of_rays(
            prior, correlation, first, none, config.likelihood == "independent"
        )
        return occupied, empty, reached

    def _told_across(self, occupied: Floats, empty: Floats, bearings: Floats) -> tuple[Floats, Floats]:
        """Every cell also hears what the neighbouring rays say, through its correlation with their cells at the same range.

        One round of messages between pairs: P(o' | E) = P(E'|E) P(o'|E') + P(not E'|E) P(o'|not E'), with prior 1/2.
        """
        share = self._config.correlation.across_rays
        middle = self._ranges + 0.5 * self._config.resolution_m
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

    def _as_window(
        self,
        eye: Floats,
        pose: Floats,
        covariance: Floats,
        bearings: Floats,
        polar: Floats,
    ) -> tuple[tuple[slice, slice], tuple[Floats, Floats]]:
        """The part of the map around the robot; the log likelihood ratio of its cells, and whether a ray came there.

        `polar` `(3, m, n)` are the likelihoods of rays and cells, and where the rays came. All are averaged over the pose.
        """
        resolution = self._config.resolution_m
        centre = self._grid.cells(eye[None])[0]
        half = int(np.ceil(self.edges_m[-1] / resolution)) + _MARGIN - 1
        rows, cols = (slice(int(c) - half, int(c) + half + 1) for c in centre)
        offset = (self._grid.corner + centre + 0.5)[::-1] * resolution - eye
        turns, weights = self._turns(covariance)
        gap = float(np.median(np.diff(bearings))) if len(bearings) > 1 else _LONE_RAY_RAD
        # Untouched cells have likelihoods of 1 either way: whatever is measured is as likely with them as without.
        parts = window_of_rays(
            polar,
            np.array([1.0, 1.0, 0.0]),
            bearings + float(pose[2]),
            _REACH_IN_GAPS * gap,
            turns,
            weights,
            offset,
            resolution,
            self._config.min_range_m,
            half,
        )
        if self._config.pose.blur:
            parts = np.stack([_blurred(part, covariance[:2, :2], resolution) for part in parts])
        return (rows, cols), (np.log(parts[0]) - np.log(parts[1]), parts[2])

    def _turns(self, covariance: Floats) -> tuple[Floats, Floats]:
        """Headings off the mean, and their weights: the distribution of the heading in a few points (Gauss-Hermite)."""
        deviation = float(np.sqrt(max(covariance[2, 2], 0.0)))
        if (
            not self._config.pose.blur
            or deviation * self.edges_m[-1] < _LEAST_BLUR * self._config.resolution_m
        ):
            return np.zeros(1), np.ones(1)
        points, weights = np.polynomial.hermite_e.hermegauss(_TURNS)
        return np.asarray(points * deviation), np.asarray(weights / weights.sum())


def _blurred(values: Floats, covariance: Floats, resolution_m: float) -> Floats:
    """The grid averaged over a displacement with this covariance `(2, 2)`, m^2."""
    in_cells = covariance / resolution_m**2
    widest = float(np.sqrt(max(np.linalg.eigvalsh(in_cells)[-1], 0.0)))
    if widest < _LEAST_BLUR:
        return values
    reach = int(np.ceil(3.0 * widest))
    offsets = np.arange(-reach, reach + 1)
    x, y = np.meshgrid(offsets, offsets)
    inverse = np.linalg.inv(in_cells + 1e-3 * np.eye(2))
    kernel = np.exp(-0.5 * (inverse[0, 0] * x * x + 2.0 * inverse[0, 1] * x * y + inverse[1, 1] * y * y))
    return np.asarray(cv2.filter2D(values, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REPLICATE))
