"""The filter over one object's pose (x, y, yaw): P(I|D) P(L|D) over weighted poses (slam-sd, eq. 6).

A visit's evidence is weighed as one block, as the trajectory filter does with a block of the path: the deviation of the lidar's
end points narrows step by step, with resampling between the steps (annealed importance sampling), so that 1000 poses
find a bin in 12 m^2 and end up to a centimetre about it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.filters.resampling import systematic_resampling
from gridslam.kernels import object_weights
from gridslam.methods.slam_sd.evidence import Evidence
from gridslam.methods.slam_sd.object_config import AntennaConfig, ObjectsConfig
from gridslam.methods.slam_sd.object_prior import Known, draw, log_prior
from gridslam.methods.slam_sd.things import Thing
from gridslam.sensors.rfid import AntennaModel

Floats = NDArray[np.float64]

RANDOM_DENSITY = 0.3  # per metre, of end points that nothing explains
CANDIDATES = 4  # poses drawn for each that the tag reads leave
LEAST_DEVIATIONS = np.array([0.005, 0.005, 0.005])
OVERLAP = -100.0  # log probability of an object that is all inside of another one
COARSE = 3  # every so many of the beams while the search is wide
SLIDE_M = 0.35
INFLATION = 2.0  # of the covariance from which the last poses are drawn


@dataclass(frozen=True, slots=True)
class Posterior:
    """The pivot's pose (3,) with covariance `(3, 3)`, the poses `(n, 3)` it was made of, and what speaks for it.

    `gain` is the log likelihood ratio of the scans with and without the object, `log_posterior` everything together.
    """

    pose: Floats
    covariance: Floats
    poses: Floats
    gain: float
    log_posterior: float


class ObjectFilter:
    """Weighs poses of one object by the evidence of one visit."""

    def __init__(self, thing: Thing, evidence: Evidence, known: Known | None, config: ObjectsConfig) -> None:
        self._thing = thing
        self._evidence = evidence
        self._known = known
        self._config = config
        self._model = antenna_model(config.antenna)

    def locate(self, rng: np.random.Generator) -> Posterior:
        """Draw, weigh by the reads, narrow down by the scans."""
        config, n = self._config, self._config.particles
        rounds = self._evidence.rounds
        readers = rounds.antennas[self._evidence.reads.any(axis=0)]
        drawn = draw(self._thing, CANDIDATES * n, readers, self._known, self._evidence.walls, config, rng)
        weight = self.log_tags(drawn) + self._log_prior(drawn, config.first_sigma_m, 0.0)
        poses = drawn[systematic_resampling(np.exp(weight - weight.max()), n, rng)]
        evidence = self._evidence.near(*_circle(poses, self._thing))
        sigmas = np.geomspace(config.first_sigma_m, config.sigma_m, config.narrowing_steps)
        coarse = evidence.thinned(COARSE)
        for step, sigma in enumerate(sigmas):
            poses = self._jitter(poses, sigma, rng)
            if self._thing.is_door and not config.uniform and 2 * step >= len(sigmas):
                self._slide(poses, rng)
            trust = step / max(len(sigmas) - 1, 1)
            seen = coarse if 2 * step < len(sigmas) else evidence
            weight = self._log_posterior(poses, seen, float(sigma), trust)
            best = int(np.argmax(weight))
            chosen = systematic_resampling(np.exp(weight - weight.max()), n, rng)
            chosen[0] = best
            poses = poses[chosen]
        return self._about(poses, evidence, rng)

    def judge(self, pose: Floats) -> float:
        """The log likelihood ratio of the scans with the object at a pose (3,) and without it."""
        return float(self._gains(pose[None], self._evidence, self._config.sigma_m)[0])

    def weigh(self, pose: Floats) -> float:
        """log P(I|D) P(L|D) P(D) of a pose (3,), up to a constant that does not depend on it."""
        return float(self._log_posterior(pose[None], self._evidence, self._config.sigma_m)[0])

    def log_tags(self, poses: Floats) -> Floats:
        """log P(I|D) of eq. 6 `(n,)`, tempered."""
        total = np.zeros(len(poses))
        for tag, reads in zip(self._thing.tags, self._evidence.reads, strict=True):
            total += self._evidence.rounds.log_likelihood(se2.compose(poses, tag), reads, self._model)
        return self._config.tag_share * total

    def _log_prior(self, poses: Floats, sigma: float, trust: float) -> Floats:
        walls = self._evidence.walls
        return log_prior(self._thing, poses, self._known, walls, 0.3 * sigma, trust, self._config)

    def _gains(self, poses: Floats, evidence: Evidence, sigma: float) -> Floats:
        """log P(L|D) of eq. 6 `(n,)`, relative to the scans without the object."""
        return np.asarray(
            object_weights.outline_gains(
                np.ascontiguousarray(poses),
                self._thing.outline,
                evidence.beams,
                evidence.ranges,
                evidence.other_m,
                sigma,
                self._config.random_share,
                RANDOM_DENSITY,
            )
        )

    def _log_posterior(self, poses: Floats, evidence: Evidence, sigma: float, trust: float = 1.0) -> Floats:
        gains = self._config.lidar_share * self._gains(poses, evidence, sigma)
        out = gains + self.log_tags(poses) + self._log_prior(poses, sigma, trust)
        return np.asarray(out + OVERLAP * self._overlap(poses, evidence.others))

    def _overlap(self, poses: Floats, others: Sequence[Floats]) -> Floats:
        """The share `(n,)` of points well inside the outline that lie in other objects: two things are not in one place."""
        inner = self._thing.inner_points
        cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
        x = poses[:, :1] + cos * inner[:, 0] - sin * inner[:, 1]
        y = poses[:, 1:2] + sin * inner[:, 0] + cos * inner[:, 1]
        points = np.column_stack([x.ravel(), y.ravel()])
        marked = np.zeros(len(points), np.bool_)
        for corners in others:
            object_weights.mark_points_on(points, corners, 0.0, marked)
        return np.asarray(marked.reshape(x.shape).mean(axis=1))

    def _jitter(self, poses: Floats, sigma: float, rng: np.random.Generator) -> Floats:
        """The small diffusion of slam-sd's objects, which keeps resampled poses apart, as wide as the step's deviation."""
        spread = 0.5 * sigma * np.array([1.0, 1.0, 1.0 / self._thing.radius_m])
        moved = poses + spread * rng.standard_normal(poses.shape)
        moved[:, 2] = se2.wrap_angle(moved[:, 2])
        return moved

    def _slide(self, poses: Floats, rng: np.random.Generator) -> None:
        """Shift every third leaf along itself: in the plane of a wall only 2 cm of thickness tell where it ends."""
        moved = poses[1::3]
        way = SLIDE_M * rng.standard_normal(len(moved))
        moved[:, 0] += way * np.cos(moved[:, 2])
        moved[:, 1] += way * np.sin(moved[:, 2])

    def _about(self, poses: Floats, evidence: Evidence, rng: np.random.Generator) -> Posterior:
        """Mean and covariance by importance sampling from a normal distribution about the best pose."""
        sigma = self._config.sigma_m
        for _ in range(2):
            weight = self._log_posterior(poses, evidence, sigma)
            best = poses[int(np.argmax(weight))]
            mean, covariance = _moments(poses, weight, best, self._thing)
            root = np.linalg.cholesky(INFLATION * covariance + np.diag(LEAST_DEVIATIONS**2))
            standard = rng.standard_normal(poses.shape)
            poses = mean + standard @ root.T
            poses[0] = best
            log_proposal = -0.5 * (standard**2).sum(axis=1)
            log_proposal[0] = log_proposal.max()
        density = self._log_posterior(poses, evidence, sigma)
        weight = density - log_proposal
        mean, covariance = _moments(poses, weight, poses[int(np.argmax(density))], self._thing)
        pose = np.array([*mean[:2], float(se2.wrap_angle(mean[2]))])
        settled = poses[systematic_resampling(np.exp(weight - weight.max()), len(poses), rng)]
        return Posterior(
            pose,
            covariance + np.diag(LEAST_DEVIATIONS**2),
            settled,
            float(self._gains(pose[None], evidence, sigma)[0]),
            float(self._log_posterior(pose[None], evidence, sigma)[0]),
        )


def antenna_model(config: AntennaConfig) -> AntennaModel:
    """The model of the reader as configured."""
    return AntennaModel(
        config.range_m,
        config.softness,
        config.detection,
        config.stray,
        config.hidden_share,
        config.least_facing,
    )


def _moments(poses: Floats, log_weight: Floats, best: Floats, thing: Thing) -> tuple[Floats, Floats]:
    """Weighted mean and covariance of the poses near the best one."""
    offset = poses - best
    offset[:, 2] = se2.wrap_angle(offset[:, 2])
    near = (np.hypot(offset[:, 0], offset[:, 1]) < thing.radius_m) & (np.abs(offset[:, 2]) < 0.6)
    weight = np.where(near, np.exp(log_weight - log_weight.max()), 0.0)
    weight /= weight.sum()
    mean = weight @ offset
    centred = offset - mean
    covariance = (centred * weight[:, None]).T @ centred
    return best + mean, covariance


def _circle(poses: Floats, thing: Thing) -> tuple[Floats, float]:
    """The circle that holds the object at all poses, with some room."""
    centres = np.column_stack([poses[:, :2], np.zeros(len(poses))])
    middle = se2.compose(np.column_stack([centres[:, :2], poses[:, 2]]), np.array([*thing.centre, 0.0]))[
        :, :2
    ]
    centre = 0.5 * (middle.min(axis=0) + middle.max(axis=0))
    return centre, float(np.hypot(*(middle - centre).T).max()) + thing.radius_m + 0.3
