"""The Rao-Blackwellised filter: particles are trajectories with maps of their own (Grisetti et al. 2007).

A key scan enters the particles' maps only after a window of later key scans. The front end has already used the scans of the
window for the matched motion, so weighting with them again would use the same information twice. On new ground no particle
matches its map, and the weights stay as they are: what a scan shows of old walls far away would wear out the particles'
diversity before it is needed. When the robot returns to a known place, not only the last pose is corrected: the path since the
particle's last match is deformed to the new end, and its map is redrawn (block sampling, Doucet, Briers and Senecal 2006).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.residual_resampling import residual_ancestors
from gridslam.kernels.scan_matching.surfel_registration import PosePriors
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.config import FilterConfig
from gridslam.methods.slam_sd.drift import Drift, deformed_path
from gridslam.methods.slam_sd.map_search import RecentSubmap, Search, search_maps
from gridslam.methods.slam_sd.particle_grids import ParticleGrids

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FIRST_CAPACITY = 256  # key scans; doubled when it is full
MATCHING_POINTS = 80  # largest number of points of a key scan: each is matched in every particle's map
INFORMATION_WEIGHT = 0.05  # weight of a scan's match: the errors of neighbouring points are not independent
LIKELIHOOD_WEIGHT = 0.01  # power of the scan likelihood in a particle's weight, for the same reason
MAX_EVIDENCE = 1.0  # one observation of objects lowers a log weight by at most this
# And one scan by this: key scans see the same walls for metres, and other particles still search
MAX_SCAN_EVIDENCE = 0.2
RESAMPLING_RATIO = 0.5  # particles are resampled when N_eff falls below this fraction of their number
REDRAWING_DISTANCE_M = 0.1  # a map is redrawn when the path of the scans in it moves farther
MIN_DEFORMATION_M = 0.03  # smaller corrections move the last pose only
MIN_DEFORMATION_RAD = 0.01

SEARCH_AFTER = 20  # key scans without a match, after which a particle searches for its map
SEARCH_INTERVAL = 3  # key scans between two searches


class ParticleFilter:
    """Particles with weights; each has its path over all key scans, its surface map and its log-odds map."""

    def __init__(
        self, particles: int, config: FilterConfig, memory_limit_mb: float, rng: np.random.Generator
    ) -> None:
        self._config = config
        self._rng = rng
        self.log_weights = np.zeros(particles)
        self.grids = ParticleGrids(particles, memory_limit_mb)
        self.drift = Drift(particles)
        self.resamplings = 0
        self.redrawn_maps = 0
        self.matched_particles = 0  # at the last key scan
        self._paths = np.zeros((particles, FIRST_CAPACITY, 3))
        self._step_std = np.zeros((FIRST_CAPACITY, 3))  # of the step to each key scan
        self._track = [np.zeros(3)]  # the front end's poses of the key scans
        self._scans: list[PreparedScan] = []
        self._inserted = 0  # number of key scans in the maps
        self._best = 0

    @property
    def poses(self) -> Floats:
        """Present poses `(n, 3)`."""
        return np.asarray(self._paths[:, max(len(self._scans) - 1, 0)])

    def trajectory(self, particle: int) -> Floats:
        """The poses `(k, 3)` of one particle at all key scans."""
        return np.asarray(self._paths[particle, : len(self._scans)].copy())

    @property
    def best_trajectory(self) -> Floats:
        """The poses `(k, 3)` of the best particle at all key scans."""
        return self.trajectory(self._best)

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
    def position_std_m(self) -> float:
        """Standard deviation of the particles' positions."""
        poses = self.poses
        return float(np.sqrt(np.trace(np.cov(poses[:, :2].T)))) if len(poses) > 1 else 0.0

    @property
    def best(self) -> int:
        """The particle with the largest weight; among equal ones the previous best, also after resampling."""
        return self._best

    @property
    def memory_mb(self) -> float:
        """Memory of all maps in 10^6 bytes."""
        return self.grids.memory_mb

    @property
    def diagnostics(self) -> dict[str, float]:
        """Values at the last key scan for the report: effective sample size, particles' std (m), matched fraction."""
        return {
            "effective_sample_size": self.effective_sample_size,
            "particle_std": self.position_std_m,
            "matched_particles": self.matched_particles / len(self.poses),
        }

    def add_key_scan(self, scan: PreparedScan, step: Floats, step_std: Floats) -> None:
        """One step of the filter: predict, match, weigh, resample, update the maps.

        `step` (3,) is the front end's motion since the last key scan, `step_std` (3,) its standard deviations.
        """
        self._predict(scan, step, step_std)
        if len(self._scans) > 1:
            likelihood = self._match(scan)
            if self.matched_particles:
                gain = LIKELIHOOD_WEIGHT * (likelihood - likelihood.max())
                self._add_evidence(np.maximum(gain, -MAX_SCAN_EVIDENCE))
            self._resample_if_needed()
        while len(self._scans) - self._inserted > self._config.window_key_scans:
            poses = np.ascontiguousarray(self._paths[:, self._inserted])
            self.grids.insert(self._scans[self._inserted], poses)
            self._inserted += 1

    @property
    def next_inserted(self) -> int | None:
        """Index of the key scan that enters the maps when the next one is added; None while the window is not full."""
        return self._inserted if len(self._scans) >= self._config.window_key_scans else None

    def replace_scan(self, key: int, scan: PreparedScan) -> None:
        """Replace a key scan that has not entered the maps yet."""
        self._scans[key] = scan

    def add_evidence(self, log_likelihood: Floats) -> None:
        """Weight the particles by another observation than the scan: `(n,)` log likelihoods, bounded below the largest.

        For tagged objects this is P(I|D) P(L|D) of slam-sd's eq. 6 (`landmarks.py`).
        """
        self._add_evidence(log_likelihood - log_likelihood.max())

    def _predict(self, scan: PreparedScan, step: Floats, step_std: Floats) -> None:
        """Move every particle by the step with its own noise sample (the robot's part of slam-sd's prediction)."""
        key = len(self._scans)
        if key == self._paths.shape[1]:
            self._paths = np.concatenate([self._paths, np.zeros_like(self._paths)], axis=1)
            self._step_std = np.concatenate([self._step_std, np.zeros_like(self._step_std)])
        self._scans.append(scan)
        self._step_std[key] = step_std
        if key:
            self._track.append(se2.compose(self._track[-1], step))
            before = self._paths[:, key - 1]
            noise = self._rng.standard_normal(before.shape) * step_std
            self._paths[:, key] = se2.compose(before, step + noise)
            self.drift.add_step(before, self._paths[:, key], step_std)

    def _match(self, scan: PreparedScan) -> Floats:
        """Improved proposal: draw every particle at its match in its own map. Returns log P(L|X) `(n,)`."""
        min_inlier_ratio = self._config.min_inlier_ratio
        points = scan.subset(MATCHING_POINTS)
        predicted = self.poses.copy()
        priors = PosePriors(predicted, self.drift.information())
        found = self.grids.register(points, predicted, priors, min_inlier_ratio)
        lost = self.drift.unmatched_key_scans > SEARCH_AFTER
        found.inlier_ratio[lost] = 0.0
        if lost.any() and len(self._scans) % SEARCH_INTERVAL == 0:
            recent = RecentSubmap.of(self._scans[self._inserted :], self._track[self._inserted :])
            again = search_maps(
                self.grids, recent, Search(predicted, self.drift, lost), min_inlier_ratio, self._rng
            )
            for old, new in zip(found, again, strict=True):
                old[lost] = new[lost]
        is_matched = found.inlier_ratio >= min_inlier_ratio
        self.matched_particles = int(is_matched.sum())
        if is_matched.any():
            self._draw(predicted, found.poses, INFORMATION_WEIGHT * found.information, is_matched)
        return self.grids.log_likelihood(scan.viewpoint, points, self.poses)

    def _draw(self, predicted: Floats, matched: Floats, information: Floats, is_matched: Bools) -> None:
        """Draw the matched particles' poses about their matches, and deform their paths to them."""
        key = len(self._scans) - 1
        step_information = np.diag(1.0 / self._step_std[key] ** 2)
        root = np.linalg.cholesky(np.linalg.inv(information + step_information))
        noise = np.einsum("nij,nj->ni", root, self._rng.standard_normal(matched.shape))
        drawn = matched + noise
        drawn[:, 2] = se2.wrap_angle(drawn[:, 2])
        correction = drawn - predicted
        is_large = (np.hypot(correction[:, 0], correction[:, 1]) > MIN_DEFORMATION_M) | (
            np.abs(se2.wrap_angle(correction[:, 2])) > MIN_DEFORMATION_RAD
        )
        for particle in np.flatnonzero(is_matched & is_large & (self.drift.anchor < key - 1)):
            self._deform_path(int(particle), drawn[particle])
        self._paths[is_matched, key] = drawn[is_matched]
        self.drift.add_match(is_matched, information, key)

    def _deform_path(self, particle: int, end: Floats) -> None:
        """Deform the path since its anchor to end at a pose (3,), and redraw the map if scans in it move."""
        key, anchor = len(self._scans) - 1, int(self.drift.anchor[particle])
        path = self._paths[particle, anchor : key + 1]
        deformed = deformed_path(path, end, self._step_std[anchor + 1 : key + 1])
        inserted = max(self._inserted - anchor, 0)
        moved_m = np.hypot(*(deformed - path)[:inserted, :2].T)
        self._paths[particle, anchor : key + 1] = deformed
        if inserted and moved_m.max() > REDRAWING_DISTANCE_M:
            self.redrawn_maps += 1
            self.grids.redraw(
                particle, self._scans[: self._inserted], self._paths[particle, : self._inserted]
            )

    def _add_evidence(self, gain: Floats) -> None:
        """Add log likelihoods `(n,)`, relative to the largest, to the log weights (P(L|X) of slam-sd's eq. 6)."""
        self.log_weights += np.maximum(gain, -MAX_EVIDENCE)
        self.log_weights -= self.log_weights.max()
        heaviest = int(np.argmax(self.log_weights))
        if self.log_weights[heaviest] > self.log_weights[self._best]:
            self._best = heaviest

    def _resample_if_needed(self) -> None:
        """Residual resampling, as in slam-sd's paper, when N_eff = 1 / sum w^2 falls below `RESAMPLING_RATIO`."""
        n = len(self.log_weights)
        if self.effective_sample_size >= RESAMPLING_RATIO * n:
            return
        ancestors = residual_ancestors(self.weights, self._rng)
        self.grids.redistribute(ancestors)
        self._paths = self._paths[ancestors]
        self.drift.select(ancestors)
        self.log_weights = np.zeros(n)
        self.resamplings += 1
