"""The Rao-Blackwellised filter: particles are trajectories with maps of their own (Grisetti et al. 2007)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import log_odds, surfels
from gridslam.maps.tiled import TileStore
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(slots=True)
class _History:
    """Poses and ancestors of all particles at every key scan."""

    poses: list[Floats]
    parents: list[Ints]


class ParticleMaps:
    """Particles `(n, 3)` with weights, each with its surfaces and its log-odds map."""

    def __init__(self, config: SlamSdConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        n = config.particles
        self.poses = np.zeros((n, 3))
        self.log_weights = np.zeros(n)
        self.surfaces = TileStore(n, surfels.CHANNELS, config.filter.resolution_m, config.memory_limit_mb)
        self.cells = TileStore(n, 1, config.filter.free_resolution_m, config.memory_limit_mb)
        self.resamplings = 0
        self._waiting: deque[tuple[PreparedScan, Floats]] = deque()
        self._history = _History([], [])
        self._parents = np.arange(n)

    @property
    def weights(self) -> Floats:
        """Normalised weights `(n,)`."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return np.asarray(weights / weights.sum())

    @property
    def effective_sample_size(self) -> float:
        """N_eff = 1 / sum w^2."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def best(self) -> int:
        """The particle with the largest weight (the first of equals)."""
        return int(np.argmax(self.log_weights))

    def predict_and_match(self, scan: PreparedScan, step: Floats, step_information: Floats) -> None:
        """Improved proposal: the matched motion `step` (3,) with its information, refined on every particle's own map."""
        config = self._config.filter
        points, normals = scan.subset(config.max_points)
        predicted = se2.compose(self.poses, step)
        share = config.scan_information_share
        prior = _turned(step_information, self.poses[:, 2])
        matched, information, used = surfels.register_all(
            self.surfaces.directory,
            self.surfaces.pool,
            self.surfaces.origin,
            config.resolution_m,
            points,
            normals,
            predicted,
            prior / share,
            config.sigma_m,
            config.reach_m,
            0.1,
            6,
        )
        self.log_weights += config.likelihood_share * self._log_likelihood(scan.viewpoint, points, normals, matched)
        covariance = np.linalg.inv(share * information + prior)
        noise = np.einsum("nij,nj->ni", np.linalg.cholesky(covariance), self._rng.standard_normal(matched.shape))
        self.poses = matched + noise
        self.poses[:, 2] = se2.wrap_angle(self.poses[:, 2])

    def _log_likelihood(self, viewpoint: Floats, points: Floats, normals: Floats, poses: Floats) -> Floats:
        config = self._config.filter
        return np.asarray(
            surfels.log_likelihood_all(
                self.surfaces.directory,
                self.surfaces.pool,
                self.surfaces.origin,
                config.resolution_m,
                viewpoint,
                points,
                normals,
                poses,
                config.sigma_m,
                config.reach_m,
                config.random_share,
                self.cells.directory,
                self.cells.pool,
                self.cells.origin,
                config.free_resolution_m,
            )
        )

    def resample_if_needed(self) -> bool:
        """Residual resampling when N_eff falls below its share of the particles."""
        self.log_weights -= self.log_weights.max()
        n = len(self.poses)
        if self.effective_sample_size >= self._config.filter.resample_below * n:
            return False
        ancestors = residual_ancestors(self.weights, self._rng)
        self.surfaces.redistribute(ancestors)
        self.cells.redistribute(ancestors)
        self.poses = self.poses[ancestors]
        self._parents = self._parents[ancestors]
        self._waiting = deque((scan, poses[ancestors]) for scan, poses in self._waiting)
        self.log_weights = np.zeros(n)
        self.resamplings += 1
        return True

    def insert(self, scan: PreparedScan) -> None:
        """Every particle takes the scan into its own map, but only when the front end has forgotten it.

        What the front end still remembers has been used for the matched motion already; weighing the particles
        with it again would tell nothing about their drift, only wear out their diversity.
        """
        self._waiting.append((scan, self.poses.copy()))
        while len(self._waiting) > self._config.filter.delay_key_scans:
            self._insert(*self._waiting.popleft())

    def _insert(self, scan: PreparedScan, poses: Floats) -> None:
        config = self._config
        maps = np.arange(len(poses))
        points, normals = scan.surface, scan.surface_normals
        self.surfaces.own_end_points(maps, poses, points)
        surfels.insert_surfels_all(
            self.surfaces.directory,
            self.surfaces.pool,
            self.surfaces.origin,
            config.filter.resolution_m,
            poses,
            points,
            normals,
        )
        self.cells.own_beams(maps, poses, scan.viewpoint, scan.points)
        log_odds.insert_beams_all(
            self.cells.directory,
            self.cells.pool,
            self.cells.origin,
            config.filter.free_resolution_m,
            poses,
            scan.viewpoint,
            scan.points,
            config.map.hit,
            config.map.miss,
            config.map.limit,
        )

    def remember(self) -> None:
        """Close the step: keep the poses and who came from whom."""
        self._history.poses.append(self.poses.copy())
        self._history.parents.append(self._parents)
        self._parents = np.arange(len(self.poses))

    def trajectory(self, particle: int) -> Floats:
        """The poses `(k, 3)` of one particle at all key scans."""
        out = np.empty((len(self._history.poses), 3))
        for k in range(len(out) - 1, -1, -1):
            out[k] = self._history.poses[k][particle]
            particle = int(self._history.parents[k][particle])
        return out


def residual_ancestors(weights: Floats, rng: np.random.Generator) -> Ints:
    """Residual resampling: floor(n w) copies for sure, the rest drawn from the remainders; survivors keep their place."""
    n = len(weights)
    counts = np.floor(n * weights).astype(np.int64)
    rest = n - int(counts.sum())
    if rest:
        remainder = n * weights - counts
        drawn = rng.choice(n, size=rest, p=remainder / remainder.sum())
        counts += np.bincount(drawn, minlength=n)
    ancestors = np.where(counts > 0, np.arange(n), -1)
    extra = np.repeat(np.arange(n), np.maximum(counts - 1, 0))
    ancestors[ancestors < 0] = extra
    return ancestors


def _turned(information: Floats, yaws: Floats) -> Floats:
    """Information `(3, 3)` in the robot's frame as `(n, 3, 3)` in the map's, for robots of the given yaws."""
    c, s = np.cos(yaws), np.sin(yaws)
    rotation = np.zeros((len(yaws), 3, 3))
    rotation[:, 0, 0], rotation[:, 0, 1], rotation[:, 1, 0], rotation[:, 1, 1] = c, -s, s, c
    rotation[:, 2, 2] = 1.0
    return rotation @ information @ rotation.transpose(0, 2, 1)
