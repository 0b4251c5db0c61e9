"""The filter: predict, weigh, estimate, resample; and search the map when the answer is in doubt."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import ConfigError
from gridslam.core.stopwatch import Stopwatch
from gridslam.filters.free_space import draw_free_poses, free_cells
from gridslam.filters.particles import Belief, Particles, main_cluster, moments
from gridslam.filters.resampling import AdaptiveSize, resample, systematic_resampling
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ispace_mcl.assessment import Assessment, Watch
from gridslam.methods.ispace_mcl.camera_config import SightingConfig
from gridslam.methods.ispace_mcl.config import IspaceMclConfig
from gridslam.methods.ispace_mcl.environment import (
    DensityWeight,
    Frame,
    SightingWeight,
    all_moving,
    proposals,
)
from gridslam.methods.ispace_mcl.relocalization import Contender, Tracked
from gridslam.methods.ispace_mcl.weighing import log_weight_of
from gridslam.methods.ispace_mcl.window import ScanWindow
from gridslam.motion.odometry_model import OdometryNoise, sample_motion
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.likelihood_field import distance_field, occupied_cells
from gridslam.sensors.pose_search import PoseSearch, SearchSettings
from gridslam.sensors.range_caster import range_caster
from gridslam.sensors.sight import Sight

Floats = NDArray[np.float64]

_MEMORY = 0.8  # of the cameras' agreement
_DOUBT = -0.3  # below this the cameras look at the belief and see nothing there
_JUMP_SCATTER = np.array([0.5, 0.5, 0.3])


@dataclass(frozen=True, slots=True)
class Update:
    """What one scan came to: the estimate as `estimate` of the config asks for it, and how sure the main cluster is.

    `spread_m` is the standard deviation of the position over all particles (figure 10).
    """

    belief: Belief
    assessment: Assessment
    particles: int
    spread_m: float


def _check_start(start: tuple[float, float, float], occupancy: OccupancyGrid) -> None:
    """ConfigError for a start off the map: there no scan could ever tell the filter where it is."""
    shape = occupancy.probability.shape
    reach = occupancy.geometry.resolution_m * 2.0**31  # no grid has more cells: no cast may overflow
    cell = occupancy.geometry.cells(np.clip(np.array([start[:2]]), -reach, reach))[0]
    if not ((cell >= 0) & (cell < shape)).all():
        corner, far = occupancy.geometry.centres(np.array([[0, 0], [shape[0] - 1, shape[1] - 1]]))
        raise ConfigError(
            f"method.start: ({start[0]:g}, {start[1]:g}) lies off the map, which reaches from "
            f"({corner[0]:.2f}, {corner[1]:.2f}) to ({far[0]:.2f}, {far[1]:.2f}) m"
        )


class Localizer:
    """Monte Carlo localization on one map."""

    def __init__(self, config: IspaceMclConfig, occupancy: OccupancyGrid, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        occupied = occupied_cells(occupancy, config.occupied_from)
        self._occupancy = occupancy
        self._free = free_cells(occupancy, config.free_below)
        field = distance_field(occupied, occupancy.geometry, config.field_reach_m)
        self._log_weight = log_weight_of(config.weight, field, occupied)
        caster = range_caster(occupied, occupancy.geometry)
        sight = Sight(field, caster, config.confidence.sight_tolerance_m, config.confidence.sight_slack_m)
        self._watch = Watch(config.confidence, sight)
        self._window = ScanWindow(config.search)
        self._contender: Contender | None = None
        if config.search.enabled:
            search = PoseSearch(field, self._free, _search_settings(config))
            self._contender = Contender(search, sight, config.search)
        noise = config.motion.model_dump(
            include={"alpha1", "alpha2", "alpha3", "alpha4", "wild_share", "wild_factor"}
        )
        self._noise = OdometryNoise(**noise)
        size = config.particles
        self._size = AdaptiveSize(
            size.least, size.most, size.kld_error, size.kld_quantile, size.bin_m, size.bin_rad
        )
        self.particles = self._start()
        self._is_started = config.start is not None
        self._since_search = (
            config.search.retry_m
        )  # a start pose that does not fit at all is contested at once
        self._is_checked = False
        self._trust = config.search.start_trust if self._is_started else 0.0
        sightings = config.cameras.weight
        self._agreement = 0.0  # running mean of what the cameras say for the belief
        self._sightings: SightingWeight | None = None
        self._density: DensityWeight | None = None
        if isinstance(sightings, SightingConfig):
            self._sightings = SightingWeight(config.cameras, sightings)
        else:
            self._density = DensityWeight(sightings)
        self.counters: Counter[str] = Counter()
        self.stopwatch = Stopwatch()

    def update(
        self, step: Floats, odometry: Floats, beams: Beams, broken: bool, frames: Sequence[Frame] = ()
    ) -> Update:
        """One round of the filter: motion since the last one `(3,)`, T_odom_base `(3,)`, the scan, and what cameras saw."""
        travel = float(np.hypot(step[0], step[1]))
        with self.stopwatch.stage("propagate"):
            self._predict(step, broken)
        self._window.add(odometry, beams.extrinsics[:2], beams.points)
        self._since_search += travel
        if not self._is_started:
            with self.stopwatch.stage("search"):
                self._is_started = self._compete(None, frames)
        with self.stopwatch.stage("weigh"):
            self._weigh(beams, all_moving(frames))
        with self.stopwatch.stage("environment"):
            self._weigh_by_cameras(frames)
        with self.stopwatch.stage("assess"):
            belief = self._cluster()
            assessment = self._watch.assess(belief, beams)
        self._agree(frames, belief)
        self._earn_trust(assessment, travel)
        if self._is_search_due(assessment):
            with self.stopwatch.stage("search"):
                if self._compete(belief, frames):
                    belief = self._cluster()
                    assessment = self._watch.assess(belief, beams)
        count, everything = len(self.particles), moments(self.particles)
        with self.stopwatch.stage("resample"):
            self._resample()
        if frames:
            with self.stopwatch.stage("propose"):
                self._propose(frames, beams, belief)
        estimate = everything if self._config.estimate == "mean" else belief
        return Update(estimate, assessment, count, everything.spread_m)

    def _weigh_by_cameras(self, frames: Sequence[Frame]) -> None:
        """The environment weight: relative likelihoods, or the paper's product of densities."""
        if not frames:
            return
        if self._sightings is not None:
            self.particles = self.particles.reweighted(
                self._sightings.log_likelihood(frames, self.particles.poses)
            )
        elif self._density is not None:
            self.particles = self._density.reweighted(frames, self.particles)

    def _agree(self, frames: Sequence[Frame], belief: Belief) -> None:
        """Keep in mind whether the cameras see the robot where it is believed to be."""
        if frames:
            said = float(self._by_cameras(frames, belief.mean[None])[0])
            self._agreement = _MEMORY * self._agreement + (1.0 - _MEMORY) * said

    def _by_cameras(self, frames: Sequence[Frame], poses: Floats) -> Floats:
        """What the cameras say for poses `(n, 3)` that a search has found, `(n,)`."""
        if self._sightings is None:
            return np.zeros(len(poses))
        return self._sightings.log_likelihood(frames, poses)

    def _propose(self, frames: Sequence[Frame], beams: Beams, belief: Belief) -> None:
        """While the robot is not found, some particles are drawn anew about what the cameras see moving."""
        cameras = self._config.cameras
        if not isinstance(cameras.weight, SightingConfig):
            return
        if belief.mass >= cameras.weight.sure_mass and self._agreement >= _DOUBT:
            return
        count = int(cameras.weight.proposal_share * len(self.particles))
        used = beams.thinned(self._config.scan.beams)
        if not count or not len(used.points):
            return
        moving = all_moving(frames)
        drawn = proposals(moving, lambda poses: self._log_weight(used, poses, moving), count, self._rng)
        if drawn is None:
            return
        kept = systematic_resampling(self.particles.weights, len(self.particles) - count, self._rng)
        self.particles = Particles.even(np.concatenate([self.particles.poses[kept], drawn]))
        self.counters["proposals"] += count

    def _predict(self, step: Floats, broken: bool) -> None:
        poses = sample_motion(self.particles.poses, step, self._noise, self._rng)
        if broken:  # after a jump of the odometry the robot may have moved unseen
            poses = poses + self._rng.standard_normal(poses.shape) * _JUMP_SCATTER
            poses[:, 2] = se2.wrap_angle(poses[:, 2])
            self._window.clear()
            self._is_checked = False
            self._trust = 0.0
        self.particles = Particles(poses, self.particles.weights)

    def _weigh(self, beams: Beams, moving: Floats) -> None:
        """The onboard weight; `moving` `(k, 2)` is where the cameras know of people."""
        used = beams.thinned(self._config.scan.beams)
        if len(used.points):
            self.particles = self.particles.reweighted(self._log_weight(used, self.particles.poses, moving))
        else:
            self.counters["scan.without_returns"] += 1

    def _resample(self) -> None:
        if self.particles.effective_size < self._config.particles.resample_below * len(self.particles):
            self.particles = resample(self.particles, self._size, self._rng)
            self.counters["resamplings"] += 1

    def _cluster(self) -> Belief:
        confidence = self._config.confidence
        return main_cluster(self.particles, confidence.cluster_m, confidence.cluster_rad)

    def _start(self) -> Particles:
        config = self._config
        count = config.particles.most
        if config.start is None:
            return Particles.even(draw_free_poses(self._free, self._occupancy, count, self._rng))
        _check_start(config.start, self._occupancy)
        drawn = self._rng.standard_normal((count, 3)) * config.start_deviation
        poses = np.asarray(config.start) + drawn
        poses[:, 2] = se2.wrap_angle(poses[:, 2])
        return Particles.even(poses)

    def _earn_trust(self, assessment: Assessment, travel_m: float) -> None:
        """A pose that goes on to fit while the robot moves has more and more in its favour."""
        search = self._config.search
        rate = search.trust_per_m if assessment.status == "localized" else 0.0
        if assessment.status == "lost":
            rate = -search.distrust_per_m
        self._trust = min(max(self._trust + rate * travel_m, 0.0), search.most_trust)

    def _is_search_due(self, assessment: Assessment) -> bool:
        search = self._config.search
        if self._contender is None:
            return False
        if assessment.status != "localized":
            return self._since_search >= search.retry_m
        return self._since_search >= (search.recheck_m if self._is_checked else search.check_m)

    def _compete(self, belief: Belief | None, frames: Sequence[Frame]) -> bool:
        """Search the map; `belief` is the tracked pose, None when there is none yet. Whether the particles have changed."""
        if self._contender is None:
            return False
        self._since_search = 0.0
        self.counters["searches"] += 1
        contest = self._contender.contest(
            self._window,
            None if belief is None else Tracked(self.particles, belief, self._trust),
            self._config.particles.most,
            self._rng,
            lambda poses: self._by_cameras(frames, poses),
        )
        if contest is None:
            return False
        self._is_checked = contest.is_confirmed
        if contest.particles is None:
            return False
        self.particles = contest.particles
        self._watch.restart()
        self._trust = 0.0
        self.counters["injections"] += 1
        return True


def _search_settings(config: IspaceMclConfig) -> SearchSettings:
    search = config.search
    return SearchSettings(
        search.spacing_m,
        search.headings,
        search.sigma_m,
        search.points,
        search.most_poses,
        search.refined,
        search.hypotheses,
        apart_m=0.5,
        apart_rad=0.26,
    )
