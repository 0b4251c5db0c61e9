"""The Rao-Blackwellised filter: particles are trajectories with maps of their own (Grisetti et al. 2007).

A key scan enters the particles' maps only after a window of later ones. What is in the window, the front end has used for the
matched motion already; so the map holds only what tells something new, and weights stay even until the robot comes back
to a place. When it does, not only the last pose is corrected: the path since the particle was tied to its map last is bent to
its new end, and the map with it (block sampling, Doucet, Briers and Senecal 2006).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.drift import Drift, bend
from gridslam.methods.slam_sd.particle_grids import ParticleGrids

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


class ParticleMaps:
    """Particles with weights, each with its path over all key scans, its surfaces and its log-odds map."""

    def __init__(self, config: SlamSdConfig, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        n = config.particles
        self.log_weights = np.zeros(n)
        self.grids = ParticleGrids(config)
        self.drift = Drift(n)
        self.resamplings = 0
        self.rebuilds = 0
        self.ties = 0
        self._paths = np.zeros((n, 256, 3))
        self._deviations = np.zeros((256, 3))  # of the step to each key scan
        self._scans: list[PreparedScan] = []
        self._inserted = 0  # so many of the first key scans are in the maps
        self._best = 0

    @property
    def poses(self) -> Floats:
        """Present poses `(n, 3)`."""
        return np.asarray(self._paths[:, max(len(self._scans) - 1, 0)])

    def trajectory(self, particle: int) -> Floats:
        """The poses `(k, 3)` of one particle at all key scans."""
        return np.asarray(self._paths[particle, : len(self._scans)].copy())

    @property
    def trajectories(self) -> Floats:
        """The poses `(n, k, 3)` of all particles at all key scans."""
        return self._paths[:, : len(self._scans)]

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
        """The particle with the largest weight; of equals that which had it before, resampling or not."""
        return self._best

    def add(self, scan: PreparedScan, step: Floats, deviations: Floats) -> None:
        """One step of the filter for one more key scan, `step` (3,) from the last one by the front end's reckoning.

        `deviations` (3,) are the standard deviations of the step.
        """
        self._predict(scan, step, deviations)
        if len(self._scans) > 1:
            likelihood = self._match(scan)
            self._weigh(likelihood)
            self._resample_if_needed()
        while len(self._scans) - self._inserted > self._config.filter.window_key_scans:
            poses = np.ascontiguousarray(self._paths[:, self._inserted])
            self.grids.insert(self._scans[self._inserted], poses)
            self._inserted += 1

    @property
    def next_inserted(self) -> int | None:
        """The key scan that enters the maps when the next one is added; None while the window fills."""
        return self._inserted if len(self._scans) >= self._config.filter.window_key_scans else None

    def replace_scan(self, key: int, scan: PreparedScan) -> None:
        """Take another version of a key scan that has not entered the maps yet."""
        self._scans[key] = scan

    def _predict(self, scan: PreparedScan, step: Floats, deviations: Floats) -> None:
        """Move every particle by the step and noise of its own: the robot's part of slam-sd's prediction."""
        key = len(self._scans)
        if key == self._paths.shape[1]:
            self._paths = np.concatenate([self._paths, np.zeros_like(self._paths)], axis=1)
            self._deviations = np.concatenate([self._deviations, np.zeros_like(self._deviations)])
        self._scans.append(scan)
        self._deviations[key] = deviations
        if key:
            before = self._paths[:, key - 1]
            noise = self._rng.standard_normal(before.shape) * deviations
            self._paths[:, key] = se2.compose(before, step + noise)
            self.drift.grow(before, self._paths[:, key], deviations)

    def _match(self, scan: PreparedScan) -> Floats:
        """Improved proposal: every particle is drawn to its own map where the scan fits. log P(L|X) `(n,)`."""
        config = self._config.filter
        points, normals = scan.subset(config.max_points)
        predicted = self.poses.copy()
        prior = self.drift.information()
        matched, information, fit = self.grids.register(points, normals, predicted, predicted, prior)
        lost = (fit < config.least_fit) & (self.drift.untied_steps > config.search_after)
        if lost.any() and len(self._scans) % config.search_every == 0:
            # the map itself may be bent by more than the way since the last tie tells
            floor = np.array([config.search_m, config.search_m, config.search_rad])
            wide = self.drift.information(floor)
            for _ in range(config.search_starts):
                starts = predicted + self.drift.sample(self._rng, floor)
                m, i, f = self.grids.register(points, normals, starts, predicted, wide)
                better = lost & (f > fit) & (f >= config.least_search_fit)
                matched[better], information[better], fit[better] = m[better], i[better], f[better]
            fit[~self._explains_more(scan, points, normals, matched, predicted) & lost] = 0.0
        tied = fit >= config.least_fit
        self.ties = int(tied.sum())
        if tied.any():
            self._draw(predicted, matched, config.scan_information_share * information, tied)
        return self.grids.log_likelihood(scan.viewpoint, points, normals, self.poses)

    def _explains_more(
        self, scan: PreparedScan, points: Floats, normals: Floats, found: Floats, predicted: Floats
    ) -> Bools:
        """Whether the scan is clearly likelier at the poses found than at the predicted ones `(n,)`, free space considered."""
        gain = self.grids.log_likelihood(scan.viewpoint, points, normals, found) - self.grids.log_likelihood(
            scan.viewpoint, points, normals, predicted
        )
        return np.asarray(gain > self._config.filter.search_gain * len(points))

    def _draw(self, predicted: Floats, matched: Floats, information: Floats, tied: Bools) -> None:
        """Draw the tied particles' poses about the matched ones and bend their paths to them."""
        config = self._config.filter
        key = len(self._scans) - 1
        step_information = np.diag(1.0 / self._deviations[key] ** 2)
        root = np.linalg.cholesky(np.linalg.inv(information + step_information))
        noise = np.einsum("nij,nj->ni", root, self._rng.standard_normal(matched.shape))
        drawn = matched + noise
        drawn[:, 2] = se2.wrap_angle(drawn[:, 2])
        pull = drawn - predicted
        far = (np.hypot(pull[:, 0], pull[:, 1]) > config.bend_from_m) | (
            np.abs(se2.wrap_angle(pull[:, 2])) > config.bend_from_rad
        )
        bent = tied & far & (self.drift.anchor < key - 1)
        for particle in np.flatnonzero(bent):
            self._bend(int(particle), drawn[particle])
        self._paths[tied, key] = drawn[tied]
        self.drift.tie(tied, information, key, config.anchored_m)

    def _bend(self, particle: int, end: Floats) -> None:
        """Bend the path since its anchor, and draw the map anew when that moves scans that are in it."""
        key, anchor = len(self._scans) - 1, int(self.drift.anchor[particle])
        path = self._paths[particle, anchor : key + 1]
        bent = bend(path, end, self._deviations[anchor + 1 : key + 1])
        inserted = max(self._inserted - anchor, 0)
        moved = np.hypot(*(bent - path)[:inserted, :2].T)
        self._paths[particle, anchor : key + 1] = bent
        if inserted and moved.max() > self._config.filter.rebuild_from_m:
            self.rebuilds += 1
            self.grids.draw_anew(
                particle, self._scans[: self._inserted], self._paths[particle, : self._inserted]
            )

    def _weigh(self, likelihood: Floats) -> None:
        """Add what the scan says about the particles, relative to the best, to their log weights: P(L|X) of slam-sd's eq. 6."""
        config = self._config.filter
        self._add_evidence(config.likelihood_share * (likelihood - likelihood.max()))

    def weigh_paths(self, log_likelihood: Floats) -> None:
        """Add what something else than the scan says about the particles `(n,)`, as bounded as one scan.

        Of tagged objects it is P(I|D) P(L|D) of slam-sd's eq. 6 (`landmarks.py`).
        """
        self._add_evidence(log_likelihood - log_likelihood.max())

    def _add_evidence(self, gain: Floats) -> None:
        self.log_weights += np.maximum(gain, -self._config.filter.most_evidence)
        self.log_weights -= self.log_weights.max()
        heaviest = int(np.argmax(self.log_weights))
        if self.log_weights[heaviest] > self.log_weights[self._best]:
            self._best = heaviest

    def _resample_if_needed(self) -> None:
        """Residual resampling when N_eff = 1 / sum w^2 falls below its share of the particles, as slam-sd's paper has it."""
        n = len(self.log_weights)
        if self.effective_sample_size >= self._config.filter.resample_below * n:
            return
        ancestors = residual_ancestors(self.weights, self._rng)
        self.grids.redistribute(ancestors)
        self._paths = self._paths[ancestors]
        self.drift.select(ancestors)
        self.log_weights = np.zeros(n)
        self.resamplings += 1


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
