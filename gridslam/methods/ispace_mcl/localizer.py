"""The filter: predict, weigh, estimate, resample; and search the map when the estimate is in doubt."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.stopwatch import Stopwatch
from gridslam.filters.free_space import free_cells
from gridslam.filters.particles import Belief, Particles, main_cluster, moments
from gridslam.filters.resampling import (
    AdaptiveSize,
    Strata,
    resample,
    resample_strata,
)
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.cameras.environment import (
    CameraObservation,
    DensityWeight,
    DetectionWeight,
    all_moving,
)
from gridslam.methods.ispace_mcl.confidence import ConfidenceMonitor, FilterUpdate, InlierLimits
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.continuity import DISCONTINUOUS_OVERLAP
from gridslam.methods.ispace_mcl.lasting_walls import lasting_walls
from gridslam.methods.ispace_mcl.scan_agreement import BLOCKED_TOLERANCE_M, GRAZING_SLACK_M
from gridslam.methods.ispace_mcl.search.initial_particles import initial_particles
from gridslam.methods.ispace_mcl.search.relocalization import SEARCH, Relocalizer, TrackedPose
from gridslam.methods.ispace_mcl.search.search_schedule import SearchSchedule
from gridslam.methods.ispace_mcl.weighing import log_weight_of
from gridslam.methods.ispace_mcl.window import ScanWindow
from gridslam.motion.odometry_model import OdometryNoise, sample_motion
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field, occupied_cells
from gridslam.sensors.pose_search import PoseSearch
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.visibility import VisibilityField

Floats = NDArray[np.float64]

FIELD_MAX_DISTANCE_M = 2.0  # distances to walls are stored up to this; every likelihood is flat beyond it
SLIP_NOISE_FACTOR = 3.0  # noise of the particles that slip, relative to the others
CLUSTER_M, CLUSTER_RAD = 1.0, 0.5  # radius of the main cluster
# KLD sampling (Fox 2003): 99 % probability of a distance below KLD_ERROR, with bins of the size of a cluster's core.
KLD_ERROR = 0.02
KLD_QUANTILE = 2.33
KLD_BIN_M, KLD_BIN_RAD = 0.25, 0.175
ONE_PLACE_MASS = 0.9999  # weight of the main cluster from which the particles are resampled together
_SMALLEST_STEP = 1e-9  # m, rad: an update distance of 0 makes every scan new
# Standard deviations of the motion that a jump of the odometry may hide: m, m, rad
JUMP_STD = np.array([0.5, 0.5, 0.3])


class Localizer:
    """Monte Carlo localization on one map."""

    def __init__(self, config: IspaceMclConfig, occupancy: OccupancyGrid, rng: np.random.Generator) -> None:
        advanced = config.advanced
        self._config = config
        self._rng = rng
        free = free_cells(occupancy, advanced.free_threshold)
        occupied = occupied_cells(occupancy, advanced.occupied_threshold)
        field = distance_field(occupied, occupancy.geometry, FIELD_MAX_DISTANCE_M)
        walls = lasting_walls(occupied, occupancy.geometry.resolution_m)
        caster = range_caster(walls, occupancy.geometry)
        visibility = VisibilityField(field, caster, BLOCKED_TOLERANCE_M, GRAZING_SLACK_M)
        self._log_weight = log_weight_of(config.weight, field, occupied, config.scan.beams)
        self._monitor = ConfidenceMonitor(
            InlierLimits(advanced.min_inlier_ratio, advanced.good_inlier_ratio), visibility
        )
        self._window = ScanWindow()
        self._relocalizer: Relocalizer | None = None
        if config.search.enabled:
            self._relocalizer = Relocalizer(
                PoseSearch(field, free, SEARCH), visibility, self._camera_log_likelihood
            )
        self._noise = OdometryNoise(
            **config.motion.model_dump(), wild_fraction=advanced.slip_fraction, wild_factor=SLIP_NOISE_FACTOR
        )
        self._size = AdaptiveSize(
            min=config.particles.min,
            max=config.particles.max,
            error=KLD_ERROR,
            quantile=KLD_QUANTILE,
            bin_m=KLD_BIN_M,
            bin_rad=KLD_BIN_RAD,
        )
        self.particles = initial_particles(config, free, occupancy, rng)
        self._keeps_hypotheses = config.search.enabled and advanced.camera_weight == "detection"
        self._is_initialised = config.start is not None
        self._news = 1.0  # of the next scan, from 0 to 1: the power of its likelihood
        self._schedule = SearchSchedule(has_start=self._is_initialised)
        self._detections: DetectionWeight | None = None
        self._density: DensityWeight | None = None
        if advanced.camera_weight == "detection":
            self._detections = DetectionWeight()
        else:
            self._density = DensityWeight(as_printed=advanced.camera_weight == "density-as-printed")
        self.counters: Counter[str] = Counter()
        self.stopwatch = Stopwatch()

    def update(
        self,
        step: Floats,
        odometry: Floats,
        beams: Beams,
        odometry_jumped: bool,
        observations: Sequence[CameraObservation] = (),
    ) -> FilterUpdate:
        """One round of the filter.

        `step` `(3,)` is the motion since the last round, `odometry` `(3,)` T_odom_base at the scan; `odometry_jumped` says that
        the motion is incomplete. `observations` are those of the fixed cameras.
        """
        travel_m = float(np.hypot(step[0], step[1]))
        with self.stopwatch.stage("propagate"):
            self._predict(step, odometry_jumped)
        self._window.add(odometry, beams.extrinsics[:2], beams.points, observations)
        self._schedule.travel(travel_m)
        if self._window.last_overlap < DISCONTINUOUS_OVERLAP:
            self._schedule.doubt()
        self._add_news(step)
        if not self._is_initialised:
            with self.stopwatch.stage("search"):
                self._is_initialised = self._search_map(None)
        with self.stopwatch.stage("weigh"):
            self._weigh(beams, all_moving(observations))
        with self.stopwatch.stage("environment"):
            self._weigh_by_cameras(observations)
        with self.stopwatch.stage("assess"):
            belief = self._cluster()
            assessment = self._monitor.assess(belief, beams, step)
        self._window.track(belief.mean)
        self._schedule.assessed(assessment.status, assessment.inlier_ratio, travel_m)
        if self._relocalizer is not None and self._schedule.is_due(assessment.status):
            with self.stopwatch.stage("search"):
                if self._search_map(belief):
                    belief = self._cluster()
                    assessment = self._monitor.assess(belief, beams, np.zeros(3))
        count, all_particles = len(self.particles), moments(self.particles)
        with self.stopwatch.stage("resample"):
            self._resample(belief.mass)
        is_best = self._schedule.is_trusted or (self._schedule.is_best and assessment.is_consistent)
        if not (is_best or self._relocalizer is None) or assessment.is_contradicted:
            assessment = assessment.without_trust()
        estimate = all_particles if self._config.estimate == "mean" else belief
        return FilterUpdate(estimate, assessment, count, all_particles.std_m)

    @property
    def is_map_mirrored(self) -> bool:
        """Whether the mirror image of the scans fits the map better than the scans."""
        return self._relocalizer is not None and self._relocalizer.mirror_check.is_mirrored

    def _weigh_by_cameras(self, observations: Sequence[CameraObservation]) -> None:
        """Apply the environment weight: the likelihood of detections, or the paper's product of densities."""
        if not observations:
            return
        if self._detections is not None:
            self.particles = self.particles.reweighted(
                self._detections.log_likelihood(observations, self.particles.poses)
            )
        elif self._density is not None:
            self.particles = self._density.reweighted(observations, self.particles)

    def _camera_log_likelihood(self, observations: Sequence[CameraObservation], poses: Floats) -> Floats:
        """Log-likelihoods `(n,)` of poses `(n, 3)` by the fixed cameras; 0 with the paper's densities."""
        if self._detections is None:
            return np.zeros(len(poses))
        return self._detections.log_likelihood(observations, poses)

    def _predict(self, step: Floats, odometry_jumped: bool) -> None:
        poses = sample_motion(self.particles.poses, step, self._noise, self._rng)
        if odometry_jumped:  # the robot may have moved without odometry
            poses = poses + self._rng.standard_normal(poses.shape) * JUMP_STD
            poses[:, 2] = se2.wrap_angle(poses[:, 2])
            self._window.clear()
            self._schedule.doubt()
        self.particles = Particles(poses, self.particles.weights)

    def _add_news(self, step: Floats) -> None:
        """Add the part of a scan that is new after a step `(3,)`: the map errs alike in scans from about the same pose."""
        advanced = self._config.advanced
        moved = float(np.hypot(step[0], step[1])) / max(advanced.update_distance_m, _SMALLEST_STEP)
        turned = abs(float(step[2])) / max(advanced.update_angle_rad, _SMALLEST_STEP)
        self._news = min(self._news + max(moved, turned), 1.0)

    def _weigh(self, beams: Beams, moving: Floats) -> None:
        """Apply the onboard weight; `moving` `(k, 2)` are the floor cells with detections of the cameras."""
        if len(beams.points):
            log_weights = self._log_weight(beams, self.particles.poses, moving)
            self.particles = self.particles.reweighted(self._news * log_weights)
            if self._keeps_hypotheses:  # the paper's filter takes every scan as new
                self._news = 0.0
        else:
            self.counters["scan.without_returns"] += 1

    def _resample(self, mass: float) -> None:
        """Resample when few particles carry the weight; while the pose is undecided, by strata, which keep alike places apart."""
        particles, threshold = self.particles, self._config.advanced.resample_below * len(self.particles)
        if not self._keeps_hypotheses or mass >= ONE_PLACE_MASS:
            if particles.effective_size >= threshold:
                return
            self.particles = resample(particles, self._size, self._rng)
        else:
            strata = Strata.of(particles, CLUSTER_M, CLUSTER_RAD)
            drawn = strata.flattened(particles.weights)
            if drawn.sum() ** 2 / (drawn**2).sum() >= threshold:
                return
            self.particles = resample_strata(particles, strata, self._size, self._rng)
        self.counters["resamplings"] += 1

    def _cluster(self) -> Belief:
        return main_cluster(self.particles, CLUSTER_M, CLUSTER_RAD)

    def _search_map(self, belief: Belief | None) -> bool:
        """Search the map; returns whether the particles have changed. `belief` is the tracked pose, None if there is none yet."""
        if self._relocalizer is None:
            return False
        self._schedule.searched()
        self.counters["searches"] += 1
        comparison = self._relocalizer.compare(
            self._window,
            None if belief is None else TrackedPose(self.particles, belief, self._schedule.prior_log_odds),
            self._config.particles.max,
            self._rng,
        )
        if comparison is None:
            return False
        self._schedule.confirm(comparison.is_confirmed, comparison.is_best)
        if comparison.particles is None:
            return False
        self.particles = comparison.particles
        self.counters["injections"] += 1
        if comparison.is_switch:
            self._monitor.restart()
            self._window.lose_track()
            if comparison.scans is not None:
                self._window.keep_latest(comparison.scans)
            self._schedule.switched()
        return True
