"""Monte Carlo localization in the drawing with state (x, y, yaw, scale), with one scale or two (paper section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.filters.particles import Particles, main_cluster
from gridslam.filters.resampling import systematic_resampling
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import scattered
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.global_localization import SCALE_STD, search_states

Floats = NDArray[np.float64]

START_PARTICLES = 6000  # number of particles while pose and scale are unknown
MAX_POINTS = 90  # largest number of points of a scan
POINT_WEIGHT = 0.15  # power of a point's likelihood: errors of neighbouring points are correlated
WALL_PENALTY = 1.0  # log-likelihood that a particle outside the free space loses at each update
RESAMPLE_BELOW = 0.5  # resample if N_eff falls below this fraction of the particles

# Motion noise in the drawing. It is larger than that of the front end, because drawings are deformed.
TRANSLATION_STD_M, TRANSLATION_STD_PER_M = 0.02, 0.1
ROTATION_STD_RAD, ROTATION_STD_PER_RAD, ROTATION_STD_PER_M = 0.005, 0.02, 0.02
SCALE_STD_PER_ROOT_M = 0.01  # random walk of the logarithm of the scale
ASPECT_STD_PER_ROOT_M = 0.01  # growth of the standard deviation of the difference of two log scales

ANNEALING = (0.1, 0.2, 0.4, 0.7, 1.0)  # powers of the first scan's likelihood, one round each
ANNEALING_JITTER = 0.35  # noise after each round, in units of the particles' standard deviations
START_SCALE_STD = (0.1, 0.1)  # upper bound of that noise's log scales, before the factor above
REVISIT_SCATTER = np.array([0.1, 0.1, 0.03, 0.03, 0.03])  # metres of the world, rad, log scales
CLUSTER_M, CLUSTER_RAD = 1.0, 0.5  # particles this close to the main cluster's mean belong to it


@dataclass(frozen=True, slots=True)
class DrawingBelief:
    """The main cluster: mean state `(5,)` (x, y, yaw, log scales), its standard deviations `(5,)`, and the inlier ratio."""

    state: Floats
    std: Floats
    inlier_ratio: float


class DrawingLocalizer:
    """Particles `(n, 5)`: x, y (drawing units), yaw, log scales along x and y (drawing units per metre)."""

    def __init__(self, config: HandmapSlamConfig, drawn: DrawnMap, rng: np.random.Generator) -> None:
        self._config = config
        self._drawn = drawn
        self._rng = rng
        self._likelihood = DrawnLikelihood(drawn, config.localization.sigma_m)
        self.states = np.zeros((0, 5))
        self._weights = np.zeros(0)

    def start(self, points: Floats) -> DrawingBelief:
        """Estimate pose and scale from the points `(m, 2)` of the first scan."""
        used = points[evenly_spaced(len(points), 2 * MAX_POINTS)]
        self.states = first_states(self._config, self._drawn, used, self._rng)
        previous = 0.0
        for power in ANNEALING:
            likelihood = self._likelihood.log_likelihood(used, self.states)
            self._set_weights((power - previous) * POINT_WEIGHT * likelihood)
            previous = power
            self._resample(START_PARTICLES)
            self._jitter()
        self._set_weights(np.zeros(len(self.states)))
        self._resample(self._config.localization.particles)
        return self.belief(points)

    def predict(self, step: Floats) -> None:
        """Move the particles by a motion `(3,)` of the robot (m, m, rad), scaled into the drawing, with noise."""
        states = self.states
        n = len(states)
        distance, rotation = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        noise = self._rng.standard_normal((n, 5))
        translation_std = TRANSLATION_STD_M + TRANSLATION_STD_PER_M * distance
        rotation_std = ROTATION_STD_RAD + ROTATION_STD_PER_RAD * rotation + ROTATION_STD_PER_M * distance
        dx = step[0] + translation_std * noise[:, 0]
        dy = step[1] + translation_std * noise[:, 1]
        cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
        states[:, 0] += np.exp(states[:, 3]) * (cos * dx - sin * dy)
        states[:, 1] += np.exp(states[:, 4]) * (sin * dx + cos * dy)
        states[:, 2] = se2.wrap_angle(states[:, 2] + step[2] + rotation_std * noise[:, 2])
        states[:, 3:] += (SCALE_STD_PER_ROOT_M * np.sqrt(distance) * noise[:, 3])[:, None]
        if self._config.localization.separate_scales:
            aspect = ASPECT_STD_PER_ROOT_M * np.sqrt(distance) * noise[:, 4]
            states[:, 3] += aspect
            states[:, 4] -= aspect

    def update(self, points: Floats) -> DrawingBelief:
        """Weigh the particles by a scan's points `(m, 2)`, return the belief, and resample if N_eff is low."""
        settings = self._config.localization
        used = points[evenly_spaced(len(points), MAX_POINTS)]
        likelihood = self._likelihood.log_likelihood(used, self.states)
        prior = self._aspect_prior() if settings.separate_scales else 0.0
        penalty = WALL_PENALTY * ~self._likelihood.is_free(self.states)
        with np.errstate(divide="ignore"):
            self._set_weights(np.log(self._weights) + POINT_WEIGHT * likelihood + prior - penalty)
        belief = self.belief(points)
        if 1.0 / np.sum(self._weights**2) < RESAMPLE_BELOW * len(self.states):
            self._resample(settings.particles)
        return belief

    def place_particles(self, state: Floats) -> None:
        """Move a fraction of the particles to an earlier state `(5,)`, with some scatter."""
        count = round(self._config.advanced.revisit_fraction * len(self.states))
        if not count:
            return
        chosen = systematic_resampling(self._weights, len(self.states), self._rng)
        self.states = self.states[chosen]
        self._weights = np.full(len(self.states), 1.0 / len(self.states))
        around = np.broadcast_to(state, (count, 5))
        separate_scales = self._config.localization.separate_scales
        replaced = evenly_spaced(len(self.states), count)
        self.states[replaced] = scattered(around, REVISIT_SCATTER, self._rng, separate_scales=separate_scales)

    def shift(self, offset: Floats) -> None:
        """Move all particles by `(dx, dy)` in drawing units (the motion correction of section 6.1)."""
        self.states[:, :2] += offset

    def belief(self, points: Floats) -> DrawingBelief:
        """The heaviest cluster of particles, and the inlier ratio of the points `(m, 2)` (m, robot's frame) there."""
        return belief_of(self.states, self._weights, self._likelihood, points)

    def _aspect_prior(self) -> Floats:
        """Log-density `(n,)` of the difference of the two scales, for one update: drawings are stretched within bounds."""
        half = 0.5 * (self.states[:, 3] - self.states[:, 4])
        return np.asarray(-0.5 * (half / self._config.advanced.aspect_std) ** 2 * POINT_WEIGHT)

    def _set_weights(self, log_weights: Floats) -> None:
        weights = np.exp(log_weights - log_weights.max())
        self._weights = weights / weights.sum()

    def _resample(self, count: int) -> None:
        chosen = systematic_resampling(self._weights, count, self._rng)
        self.states = self.states[chosen]
        self._weights = np.full(count, 1.0 / count)

    def _jitter(self) -> None:
        """Add noise that separates the copies of a particle, in proportion to the particles' standard deviations."""
        bounds = np.array([*self._config.advanced.start_std, *START_SCALE_STD])
        std = np.minimum(self.states.std(axis=0), bounds) * ANNEALING_JITTER
        noise = self._rng.standard_normal(self.states.shape) * std
        if not self._config.localization.separate_scales:
            noise[:, 4] = noise[:, 3]
        self.states = self.states + noise
        self.states[:, 2] = se2.wrap_angle(self.states[:, 2])


def belief_of(states: Floats, weights: Floats, likelihood: DrawnLikelihood, points: Floats) -> DrawingBelief:
    """The heaviest cluster of particles `(n, 5)` with weights `(n,)`, and the inlier ratio of the points `(m, 2)` there."""
    scale = np.exp(float(weights @ states[:, 3:].mean(axis=1)))
    cluster = main_cluster(Particles(states[:, :3], weights), CLUSTER_M * scale, CLUSTER_RAD)
    offsets = states[:, :3] - cluster.mean
    near = np.hypot(offsets[:, 0], offsets[:, 1]) < CLUSTER_M * scale
    near &= np.abs(se2.wrap_angle(offsets[:, 2])) < CLUSTER_RAD
    in_cluster = np.where(near, weights, 0.0)
    in_cluster = in_cluster / in_cluster.sum() if in_cluster.sum() > 0.0 else weights
    scales = in_cluster @ states[:, 3:]
    variance = in_cluster @ (states[:, 3:] - scales) ** 2
    state = np.concatenate([cluster.mean, scales])
    std = np.sqrt(np.concatenate([np.diag(cluster.covariance), variance]))
    return DrawingBelief(state, std, likelihood.inlier_ratio(points, state))


def first_states(
    config: HandmapSlamConfig, drawn: DrawnMap, points: Floats, rng: np.random.Generator
) -> Floats:
    """States `(n, 5)` around the given start, or around the results of global localization with points `(m, 2)`."""
    if config.start is None:
        return search_states(drawn, points, config, START_PARTICLES, rng)
    noise = rng.standard_normal((START_PARTICLES, 3)) * config.advanced.start_std
    states = np.empty((START_PARTICLES, 5))
    states[:, :3] = np.asarray(config.start) + noise
    states[:, 3:] = first_scales(config, START_PARTICLES, rng)
    return states


def first_scales(config: HandmapSlamConfig, n: int, rng: np.random.Generator) -> Floats:
    """Log scales `(n, 2)` around the given scale, or over the whole range."""
    settings, advanced = config.localization, config.advanced
    if settings.scale is not None:
        mean = np.log(settings.scale) + SCALE_STD * rng.standard_normal(n)
    else:
        low, high = settings.scale_range
        mean = rng.uniform(float(np.log(low)), float(np.log(high)), n)
    aspect = advanced.aspect_std * rng.standard_normal(n) if settings.separate_scales else np.zeros(n)
    return np.column_stack([mean + aspect, mean - aspect])
