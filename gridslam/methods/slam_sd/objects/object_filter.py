"""The filter over one object's pose (x, y, yaw): P(I|D) P(L|D) over weighted poses (slam-sd, eq. 6).

The evidence of a visit is weighted as one block, as the trajectory filter does with a block of the path. The standard deviation
of the lidar's endpoints narrows step by step, with resampling between the steps (annealed importance sampling), so that
1000 poses find a bin in 12 m^2 to a centimetre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.kernels import object_weights
from gridslam.kernels.object_weights import EndpointMixture
from gridslam.methods.slam_sd.objects.object_model import ObjectModel
from gridslam.methods.slam_sd.objects.object_settings import ObjectSettings
from gridslam.methods.slam_sd.objects.pose_prior import ObjectPosePrior, PriorEstimate
from gridslam.methods.slam_sd.objects.visit_evidence import VisitEvidence

Floats = NDArray[np.float64]

SIGMA_M = 0.02  # standard deviation of an endpoint about a footprint
FIRST_SIGMA_M = 0.3  # the same in the first annealing step
ANNEALING_STEPS = 6
LIDAR_WEIGHT = 0.3  # power of P(L|D): the errors of neighbouring beams are not independent
READ_WEIGHT = 0.25  # power of P(I|D): consecutive rounds are not independent
RANDOM_RATIO = 0.05  # ratio of readings that no surface explains
RANDOM_DENSITY = 0.3  # density per metre of endpoints that no surface explains
# Standard deviation of hinges from the plane of the wall, in sigmas of the annealing step
WALL_STD_RATIO = 0.3
DRAWN_PER_POSE = 4  # poses drawn for each one that is kept by the tag reads
COARSE_STEP = 3  # every third beam is used while the search is wide
OVERLAP_LOG_WEIGHT = -100.0  # log probability of an object that lies inside another one
DIFFUSION_RATIO = 0.5  # standard deviation of the diffusion between steps, in sigmas of the annealing step
SLIDE_STD_M = 0.35
PROPOSAL_INFLATION = 2.0  # factor of the covariance from which the last poses are drawn
PROPOSAL_ROUNDS = 2
MIN_STD = np.array([0.005, 0.005, 0.005])  # smallest standard deviations of an estimate: x, y (m), yaw (rad)
MAX_MODE_YAW_RAD = 0.6  # poses that differ more in yaw from the best one are another mode
ROOM_M = 0.3  # margin around the footprints whose beams are used


@dataclass(frozen=True, slots=True)
class ObjectPosterior:
    """The pivot's pose (3,) with covariance `(3, 3)`, and the poses `(n, 3)` that represent it.

    `gain` is the log likelihood ratio of the scans with and without the object; `log_posterior` also includes reads and prior.
    """

    pose: Floats
    covariance: Floats
    poses: Floats
    gain: float
    log_posterior: float


class ObjectFilter:
    """Weights poses of one object by the evidence of one visit."""

    def __init__(
        self,
        model: ObjectModel,
        evidence: VisitEvidence,
        earlier: PriorEstimate | None,
        settings: ObjectSettings,
    ) -> None:
        self._model = model
        self._evidence = evidence
        self._prior = ObjectPosePrior(model, earlier, evidence.walls, settings)
        self._settings = settings
        self._antenna = settings.antenna

    def locate(self, rng: np.random.Generator) -> ObjectPosterior:
        """Draw poses, weight them by the reads, and narrow them down by the scans."""
        n = self._settings.objects.particles
        readers = self._evidence.rounds.antennas[self._evidence.reads.any(axis=0)]
        drawn = self._prior.draw(DRAWN_PER_POSE * n, readers, rng)
        weight = self.log_reads(drawn) + self._log_prior(drawn, FIRST_SIGMA_M, trust=0.0)
        poses = drawn[_resampled(weight, n, rng)]
        evidence = self._evidence.near(*_circle_around(poses, self._model))
        poses = self._anneal(poses, evidence, rng)
        return self._posterior(poses, evidence, rng)

    def log_likelihood_ratio(self, pose: Floats) -> float:
        """Log likelihood ratio of the scans with the object at a pose (3,) and without it."""
        return float(self._gains(pose[None], self._evidence, SIGMA_M)[0])

    def log_posterior(self, pose: Floats) -> float:
        """log P(I|D) P(L|D) P(D) of a pose (3,), up to a constant that is the same for all poses."""
        return float(self._log_posterior(pose[None], self._evidence, SIGMA_M)[0])

    def log_reads(self, poses: Floats) -> Floats:
        """log P(I|D) of eq. 6 `(n,)`, tempered."""
        total = np.zeros(len(poses))
        for tag, reads in zip(self._model.tags, self._evidence.reads, strict=True):
            total += self._evidence.rounds.log_likelihood(se2.compose(poses, tag), reads, self._antenna)
        return READ_WEIGHT * total

    def _anneal(self, poses: Floats, evidence: VisitEvidence, rng: np.random.Generator) -> Floats:
        """Poses `(n, 3)` after the annealing steps: diffuse, weight by scans of narrowing deviation, resample."""
        sigmas = np.geomspace(FIRST_SIGMA_M, SIGMA_M, ANNEALING_STEPS)
        coarse = evidence.thinned(COARSE_STEP)
        for step, sigma in enumerate(sigmas):
            is_wide = 2 * step < len(sigmas)
            poses = self._diffuse(poses, sigma, rng)
            if self._model.is_door and self._settings.objects.is_joint and not is_wide:
                self._slide(poses, rng)
            trust = step / max(len(sigmas) - 1, 1)
            weight = self._log_posterior(poses, coarse if is_wide else evidence, float(sigma), trust)
            chosen = _resampled(weight, len(poses), rng)
            chosen[0] = int(np.argmax(weight))
            poses = poses[chosen]
        return poses

    def _log_prior(self, poses: Floats, sigma_m: float, trust: float) -> Floats:
        return self._prior.log_density(poses, WALL_STD_RATIO * sigma_m, trust)

    def _gains(self, poses: Floats, evidence: VisitEvidence, sigma_m: float) -> Floats:
        """log P(L|D) of eq. 6 `(n,)`, relative to the scans without the object."""
        mixture = EndpointMixture(sigma_m, RANDOM_RATIO, RANDOM_DENSITY)
        footprint = self._model.footprint
        return np.asarray(
            object_weights.footprint_gains(np.ascontiguousarray(poses), footprint, evidence.beams, mixture)
        )

    def _log_posterior(
        self, poses: Floats, evidence: VisitEvidence, sigma_m: float, trust: float = 1.0
    ) -> Floats:
        gains = LIDAR_WEIGHT * self._gains(poses, evidence, sigma_m)
        out = gains + self.log_reads(poses) + self._log_prior(poses, sigma_m, trust)
        return np.asarray(out + OVERLAP_LOG_WEIGHT * self._overlap(poses, evidence.footprints))

    def _overlap(self, poses: Floats, footprints: Sequence[Floats]) -> Floats:
        """Fraction `(n,)` of the object's inner points that lie in other objects' footprints `(k, 2)`."""
        inner = self._model.inner_points
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        x = poses[:, :1] + cos * inner[:, 0] - sin * inner[:, 1]
        y = poses[:, 1:2] + sin * inner[:, 0] + cos * inner[:, 1]
        points = np.column_stack([x.ravel(), y.ravel()])
        marked = np.zeros(len(points), np.bool_)
        for corners in footprints:
            object_weights.mark_points_on(points, corners, 0.0, marked)
        return np.asarray(marked.reshape(x.shape).mean(axis=1))

    def _diffuse(self, poses: Floats, sigma_m: float, rng: np.random.Generator) -> Floats:
        """The small diffusion of slam-sd's objects, which keeps resampled poses distinct, in proportion to the step's sigma."""
        std = DIFFUSION_RATIO * sigma_m * np.array([1.0, 1.0, 1.0 / self._model.radius_m])
        moved = poses + std * rng.standard_normal(poses.shape)
        moved[:, 2] = se2.wrap_angle(moved[:, 2])
        return moved

    def _slide(self, poses: Floats, rng: np.random.Generator) -> None:
        """Shift every third leaf along itself: a leaf flush with a wall is seen by its 2 cm of thickness only."""
        moved = poses[1::3]
        distance = SLIDE_STD_M * rng.standard_normal(len(moved))
        moved[:, 0] += distance * np.cos(moved[:, 2])
        moved[:, 1] += distance * np.sin(moved[:, 2])

    def _posterior(self, poses: Floats, evidence: VisitEvidence, rng: np.random.Generator) -> ObjectPosterior:
        """Mean and covariance by importance sampling from a normal distribution about the best pose."""
        for _ in range(PROPOSAL_ROUNDS):
            weight = self._log_posterior(poses, evidence, SIGMA_M)
            best = poses[int(np.argmax(weight))]
            mean, covariance = _moments(poses, weight, best, self._model)
            root = np.linalg.cholesky(PROPOSAL_INFLATION * covariance + np.diag(MIN_STD**2))
            standard = rng.standard_normal(poses.shape)
            poses = mean + standard @ root.T
            poses[0] = best
            log_proposal = -0.5 * (standard**2).sum(axis=1)
            log_proposal[0] = log_proposal.max()
        density = self._log_posterior(poses, evidence, SIGMA_M)
        weight = density - log_proposal
        mean, covariance = _moments(poses, weight, poses[int(np.argmax(density))], self._model)
        pose = np.array([*mean[:2], float(se2.wrap_angle(mean[2]))])
        return ObjectPosterior(
            pose,
            covariance + np.diag(MIN_STD**2),
            poses[_resampled(weight, len(poses), rng)],
            float(self._gains(pose[None], evidence, SIGMA_M)[0]),
            float(self._log_posterior(pose[None], evidence, SIGMA_M)[0]),
        )


def _moments(poses: Floats, log_weight: Floats, best: Floats, model: ObjectModel) -> tuple[Floats, Floats]:
    """Weighted mean (3,) and covariance `(3, 3)` of the poses `(n, 3)` in the mode of the best one (3,)."""
    offset = poses - best
    offset[:, 2] = se2.wrap_angle(offset[:, 2])
    is_near = np.hypot(offset[:, 0], offset[:, 1]) < model.radius_m
    is_near &= np.abs(offset[:, 2]) < MAX_MODE_YAW_RAD
    weight = np.where(is_near, np.exp(log_weight - log_weight.max()), 0.0)
    weight /= weight.sum()
    mean = weight @ offset
    centred = offset - mean
    covariance = (centred * weight[:, None]).T @ centred
    return best + mean, covariance


def _resampled(log_weight: Floats, n: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices `(n,)` of poses drawn by systematic resampling."""
    return systematic_resampling(np.exp(log_weight - log_weight.max()), n, rng)


def _circle_around(poses: Floats, model: ObjectModel) -> tuple[Floats, float]:
    """Centre (2,) and radius (m) of a circle that contains the object at all poses `(n, 3)`, with some room."""
    centres = se2.compose(poses, np.array([*model.centre, 0.0]))[:, :2]
    centre = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    return centre, float(np.hypot(*(centres - centre).T).max()) + model.radius_m + ROOM_M
