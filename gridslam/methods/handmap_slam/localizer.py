"""Monte Carlo localization in the drawing with state (x, y, yaw, scale), the scale in one or two parts (paper section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.particles import Particles, main_cluster
from gridslam.filters.resampling import systematic_resampling
from gridslam.maps.drawing import DrawnMap
from gridslam.methods.handmap_slam.config import HandmapSlamConfig, LocalizationConfig
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.global_start import search_states

Floats = NDArray[np.float64]

ANNEALING = (0.1, 0.2, 0.4, 0.7, 1.0)  # powers of the first scan's likelihood, one after the other
RECALL_SCATTER = np.array([0.1, 0.1, 0.03, 0.03, 0.03])  # metres of the world, rad, log scales
ANNEALING_JITTER = 0.35  # of the particles' deviations, kept from round to round


@dataclass(frozen=True, slots=True)
class DrawnBelief:
    """The main cluster: mean state `(5,)` (x, y, yaw, log scales), deviations `(5,)`, and the share of scan points near walls."""

    state: Floats
    deviations: Floats
    fit: float


class DrawingLocalizer:
    """Particles `(n, 5)`: x, y (drawing metres), yaw, log scales along x and y (drawing metres per metre)."""

    def __init__(self, config: HandmapSlamConfig, drawn: DrawnMap, rng: np.random.Generator) -> None:
        self._config = config
        self._drawn = drawn
        self._rng = rng
        settings = config.localization
        self._likelihood = DrawnLikelihood(drawn, settings.sigma_m, settings.random_share)
        self.states = np.zeros((0, 5))
        self._weights = np.zeros(0)

    def start(self, points: Floats) -> DrawnBelief:
        """Find pose and scale with the points `(m, 2)` of the first scan."""
        settings = self._config.localization
        used = evenly(points, 2 * settings.points)
        self.states = self._first_states(used)
        before = 0.0
        for power in ANNEALING:
            likelihood = self._likelihood.log_likelihood(used, self.states)
            self._set_weights((power - before) * settings.point_weight * likelihood)
            before = power
            self._redraw(settings.start_particles)
            self._jitter()
        self._set_weights(np.zeros(len(self.states)))
        self._redraw(settings.particles)
        return self.belief(points)

    def move(self, step: Floats) -> None:
        """Predict: a motion `(3,)` of the robot in metres, by its scale a motion in the drawing."""
        settings, states = self._config.localization, self.states
        n = len(states)
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        drawn = self._rng.standard_normal((n, 5))
        translation = settings.translation_floor_m + settings.translation_per_m * way
        rotation = (
            settings.rotation_floor_rad + settings.rotation_per_rad * turn + settings.rotation_per_m_rad * way
        )
        dx = step[0] + translation * drawn[:, 0]
        dy = step[1] + translation * drawn[:, 1]
        cos, sin = np.cos(states[:, 2]), np.sin(states[:, 2])
        states[:, 0] += np.exp(states[:, 3]) * (cos * dx - sin * dy)
        states[:, 1] += np.exp(states[:, 4]) * (sin * dx + cos * dy)
        states[:, 2] = se2.wrap_angle(states[:, 2] + step[2] + rotation * drawn[:, 2])
        states[:, 3:] += (settings.scale_per_root_m * np.sqrt(way) * drawn[:, 3])[:, None]
        if settings.separate_scales:
            aspect = settings.aspect_per_root_m * np.sqrt(way) * drawn[:, 4]
            states[:, 3] += aspect
            states[:, 4] -= aspect

    def weigh(self, points: Floats) -> DrawnBelief:
        """Weigh by a scan's points `(m, 2)`, resample when N_eff is low, and tell the belief."""
        settings = self._config.localization
        used = evenly(points, settings.points)
        likelihood = self._likelihood.log_likelihood(used, self.states)
        prior = self._aspect_prior() if settings.separate_scales else 0.0
        walled = settings.wall_penalty * ~self._likelihood.is_free(self.states)
        with np.errstate(divide="ignore"):
            self._set_weights(np.log(self._weights) + settings.point_weight * likelihood + prior - walled)
        belief = self.belief(points)
        if 1.0 / np.sum(self._weights**2) < settings.resample_below * len(self.states):
            self._redraw(settings.particles)
        return belief

    def recall(self, state: Floats) -> None:
        """Put a share of the particles about a state `(5,)` in which the robot was when it was here before."""
        count = round(self._config.localization.recall_share * len(self.states))
        if not count:
            return
        chosen = systematic_resampling(self._weights, len(self.states), self._rng)
        self.states = self.states[chosen]
        self._weights = np.full(len(self.states), 1.0 / len(self.states))
        scatter = self._rng.standard_normal((count, 5)) * RECALL_SCATTER
        scatter[:, :2] *= np.exp(state[3:])
        if not self._config.localization.separate_scales:
            scatter[:, 4] = scatter[:, 3]
        which = (np.arange(count) * len(self.states)) // count
        self.states[which] = state + scatter

    def shift(self, offset: Floats) -> None:
        """Move the whole belief in the drawing by `(dx, dy)` drawing metres (the motion correction of section 6.1)."""
        self.states[:, :2] += offset

    def belief(self, points: Floats) -> DrawnBelief:
        """The heaviest cluster of particles, and how well the points fit there."""
        settings = self._config.localization
        weights = self._weights
        size = np.exp(float(weights @ self.states[:, 3:].mean(axis=1)))
        cluster = main_cluster(
            Particles(self.states[:, :3], weights), settings.cluster_m * size, settings.cluster_rad
        )
        off = self.states[:, :3] - cluster.mean
        near = np.hypot(off[:, 0], off[:, 1]) < settings.cluster_m * size
        near &= np.abs(se2.wrap_angle(off[:, 2])) < settings.cluster_rad
        share = np.where(near, weights, 0.0)
        share = share / share.sum() if share.sum() > 0.0 else weights
        scales = share @ self.states[:, 3:]
        variance = share @ (self.states[:, 3:] - scales) ** 2
        state = np.concatenate([cluster.mean, scales])
        deviations = np.sqrt(np.concatenate([np.diag(cluster.covariance), variance]))
        return DrawnBelief(state, deviations, self._likelihood.share_near(points, state))

    def _aspect_prior(self) -> Floats:
        """Log-density of the two scales' difference over one update: drawings are stretched, but not without bounds."""
        settings = self._config.localization
        half = 0.5 * (self.states[:, 3] - self.states[:, 4])
        return np.asarray(-0.5 * (half / settings.aspect_deviation) ** 2 * settings.point_weight)

    def _first_states(self, points: Floats) -> Floats:
        """Particles about the given start, or about what a search of the whole drawing finds."""
        config, settings = self._config, self._config.localization
        n = settings.start_particles
        if config.start is None:
            return search_states(self._drawn, points, config, self._rng)
        drawn = self._rng.standard_normal((n, 3)) * settings.start_deviation
        states = np.empty((n, 5))
        states[:, :3] = np.asarray(config.start) + drawn
        states[:, 3:] = first_scales(settings, n, self._rng)
        return states

    def _set_weights(self, log_weights: Floats) -> None:
        weights = np.exp(log_weights - log_weights.max())
        self._weights = weights / weights.sum()

    def _redraw(self, count: int) -> None:
        chosen = systematic_resampling(self._weights, count, self._rng)
        self.states = self.states[chosen]
        self._weights = np.full(count, 1.0 / count)

    def _jitter(self) -> None:
        """Spread copies of a particle by a share of the particles' own deviations, about clusters of which nothing is known."""
        settings = self._config.localization
        widths = np.array([*settings.start_deviation, 0.1, 0.1])
        deviations = np.minimum(self.states.std(axis=0), widths) * ANNEALING_JITTER
        drawn = self._rng.standard_normal(self.states.shape) * deviations
        if not settings.separate_scales:
            drawn[:, 4] = drawn[:, 3]
        self.states = self.states + drawn
        self.states[:, 2] = se2.wrap_angle(self.states[:, 2])


def first_scales(settings: LocalizationConfig, n: int, rng: np.random.Generator) -> Floats:
    """Log scales `(n, 2)` about the given one, or over the whole range."""
    if settings.scale is not None:
        size = np.log(settings.scale) + settings.scale_deviation * rng.standard_normal(n)
    else:
        low, high = settings.scale_range
        size = rng.uniform(float(np.log(low)), float(np.log(high)), n)
    aspect = settings.aspect_deviation * rng.standard_normal(n) if settings.separate_scales else np.zeros(n)
    return np.column_stack([size + aspect, size - aspect])


def evenly(points: Floats, most: int) -> Floats:
    """At most so many of the points, spread evenly."""
    n = len(points)
    return points if n <= most else points[(np.arange(most) * n) // most]
