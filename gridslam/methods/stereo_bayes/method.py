"""stereo-bayes: an occupancy map from stereo (`map`), and the pose filter alone (`localize`)."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import (
    AbsolutePose,
    CameraInfo,
    Disparity,
    Event,
    Odometry,
    StereoPair,
    Transform,
)
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Estimate, RunResult, Series, Table
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.frames import Frame, Frames
from gridslam.methods.stereo_bayes.pose import RobotPose
from gridslam.methods.stereo_bayes.rays import RayReader
from gridslam.motion.absolute_pose_filter import PoseBelief
from gridslam.planning.obstacles import ObstacleRegion, obstacle_regions

Floats = NDArray[np.float64]

_MOST_WAITING = 200
_WAIT_FOR_ODOMETRY_NS = 2_000_000_000


class PoseTrack:
    """Follows the robot's pose; subclasses decide what a frame does and which moments are kept."""

    def __init__(self, config: StereoBayesConfig, seed: int) -> None:
        self._config = config
        self._pose = RobotPose(config.pose)
        self._frames = Frames(config)
        self._waiting: deque[StereoPair | Disparity] = deque()
        self._stamps: list[int] = []
        self._beliefs: list[PoseBelief] = []
        self._counters: Counter[str] = Counter()
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The filter's pose at the last moment that was kept."""
        if not self._beliefs:
            return None
        return Estimate(self._stamps[-1], self._beliefs[-1].pose)

    @property
    def timings_s(self) -> Mapping[str, float]:
        """Seconds spent in each stage so far."""
        return self._stopwatch.seconds

    def process(self, event: Event) -> None:
        """Odometry, fixes, stereo pairs or disparities, and the geometry of the head are used."""
        if isinstance(event, Odometry):
            self._pose.add_odometry(event)
            self._moved(event.stamp_ns)
        elif isinstance(event, AbsolutePose):
            self._pose.add_fix(event)
        elif isinstance(event, CameraInfo):
            self._frames.add_info(event)
        elif isinstance(event, Transform):
            if event.is_static:
                self._frames.add_extrinsics(event)
        elif isinstance(event, StereoPair | Disparity):
            self._waiting.append(event)
            if len(self._waiting) > _MOST_WAITING:
                self._skip(self._waiting.popleft(), "no_pose")
        self._take_waiting(is_last=False)

    def _finish(self) -> None:
        self._pose.begin()
        self._take_waiting(is_last=True)
        while self._waiting:
            self._skip(self._waiting.popleft(), "no_pose")

    def _moved(self, stamp_ns: int) -> None:
        """Odometry has come."""

    def _use(self, frame: Frame, belief: PoseBelief) -> None:
        """A frame and where the robot was."""

    def _take_waiting(self, is_last: bool) -> None:
        while self._waiting:
            image = self._waiting[0]
            if self._pose.is_visual is None:
                newest = self._waiting[-1].stamp_ns
                if not is_last and newest - image.stamp_ns < _WAIT_FOR_ODOMETRY_NS:
                    return
                self._pose.is_visual = True
            if not self._pose.is_visual and not self._pose.reaches(image.stamp_ns) and not is_last:
                return
            self._waiting.popleft()
            frame = self._frame(image)
            if frame is None:
                continue
            if self._pose.is_visual:
                self._pose.add_step(frame.stamp_ns, frame.step)
                self._pose.begin()
            belief = self._pose.at(frame.stamp_ns)
            if belief is None:
                self._skip(image, "no_pose")
                continue
            self._use(frame, belief)

    def _frame(self, image: StereoPair | Disparity) -> Frame | None:
        with self._stopwatch.stage("disparity"):
            if isinstance(image, Disparity):
                if self._pose.is_visual:
                    self._skip(image, "no_motion")
                    return None
                return self._frames.of_disparity(image)
            return self._frames.of_pair(image, bool(self._pose.is_visual))

    def _keep(self, stamp_ns: int, belief: PoseBelief) -> None:
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return
        self._stamps.append(stamp_ns)
        self._beliefs.append(belief)

    def _skip(self, image: StereoPair | Disparity, reason: str) -> None:
        kind = "stereo" if isinstance(image, StereoPair) else "disparity"
        self._counters[f"skipped.{kind}.{reason}"] += 1

    def _trajectory(self) -> Trajectory:
        if not self._stamps:
            return Trajectory.empty()
        return Trajectory(np.array(self._stamps, np.int64), np.array([b.pose for b in self._beliefs]))

    def _series(self) -> dict[str, Series]:
        stamps = np.array(self._stamps, np.int64)
        variances = np.array([np.diag(b.covariance) for b in self._beliefs]).reshape(-1, 3)
        return {
            "position_deviation": Series(stamps, np.sqrt(variances[:, 0] + variances[:, 1]), "m"),
            "heading_deviation": Series(stamps, np.degrees(np.sqrt(variances[:, 2])), "deg"),
        }

    def _all_counters(self) -> dict[str, int]:
        return dict(self._counters + self._frames.counters + self._pose.counters)


class StereoBayes(PoseTrack):
    """`gridslam map`: the pose filter, and a map of what the stereo head sees."""

    def __init__(self, config: StereoBayesConfig, seed: int) -> None:
        super().__init__(config, seed)
        self._map = BeliefMap(config)
        self._rays = RayReader(config, self._counters)
        self._r0: list[float] = []

    def result(self) -> RunResult:
        """The map, the poses of the frames, the obstacles, and the filter's deviations."""
        self._finish()
        occupancy = self._map.occupancy()
        stamps = np.array(self._stamps, np.int64)
        series = self._series()
        if self._config.correlation.mode == "adaptive":
            series["correlation"] = Series(stamps, np.array(self._r0), "")
        return RunResult(
            self._trajectory(),
            occupancy,
            layers={"probability": self._map.layer()},
            tables={"obstacles": self._obstacles(occupancy)},
            series=series,
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
            measures={"correlation_r0": self._map.correlation.r0},
        )

    def _use(self, frame: Frame, belief: PoseBelief) -> None:
        with self._stopwatch.stage("observe"):
            rays = self._rays.read(frame.disparity, frame.head)
        with self._stopwatch.stage("map"):
            covariance = belief.covariance if self._pose.is_fixed else np.zeros((3, 3))
            self._map.update(
                belief.pose, covariance, rays, self._map.noise(float(self._config.disparity.disparities))
            )
        self._r0.append(self._map.correlation.r0)
        self._keep(frame.stamp_ns, belief)

    def _obstacles(self, occupancy: OccupancyGrid) -> Table:
        if not occupancy.probability.size:
            return Table(ObstacleRegion.columns(), [])
        regions = obstacle_regions(occupancy, self._config.robot_radius_m)
        return Table(ObstacleRegion.columns(), [region.row() for region in regions])


class StereoBayesPose(PoseTrack):
    """`gridslam localize`: the pose filter alone, a pose at every odometry, or at every frame with visual odometry."""

    def __init__(self, config: StereoBayesConfig, seed: int, occupancy: OccupancyGrid | None = None) -> None:
        super().__init__(config, seed)
        self._odometry_ns: deque[int] = deque()

    def result(self) -> RunResult:
        """The poses and their deviations."""
        self._finish()
        self._settle(float("inf"))
        return RunResult(
            self._trajectory(),
            series=self._series(),
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
        )

    def _moved(self, stamp_ns: int) -> None:
        """Poses are kept when fixes that come late have had their time."""
        if not self._pose.is_visual:
            self._odometry_ns.append(stamp_ns)
            self._settle(stamp_ns - 0.5e9 * self._config.pose.window_s)

    def _settle(self, before_ns: float) -> None:
        while self._odometry_ns and self._odometry_ns[0] < before_ns:
            stamp = self._odometry_ns.popleft()
            belief = self._pose.at(stamp)
            if belief is not None:
                self._keep(stamp, belief)

    def _frame(self, image: StereoPair | Disparity) -> Frame | None:
        return super()._frame(image) if self._pose.is_visual else None

    def _use(self, frame: Frame, belief: PoseBelief) -> None:
        self._keep(frame.stamp_ns, belief)
