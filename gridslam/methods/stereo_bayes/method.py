"""stereo-bayes: an occupancy map from stereo (`map`), and the pose filter alone (`localize`)."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
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
from gridslam.methods.stereo_bayes.frames import FrameBuilder, StereoFrame
from gridslam.methods.stereo_bayes.pose import WINDOW_NS, RobotPose
from gridslam.methods.stereo_bayes.rays import RayReader
from gridslam.motion.absolute_pose_filter import PoseBelief
from gridslam.planning.obstacles import ObstacleRegion, obstacle_regions

Floats = NDArray[np.float64]

MAX_WAITING = 200  # images
SKIPPED_IMAGES = ("skipped.stereo.", "skipped.disparity.")
ADVICE = {
    "no_calibration": "the log needs camera_info of both cameras, or focal length and baseline in its disparity messages",
    "no_motion": "disparity images need odometry",
    "narrower_than_disparities": "set method.disparity.disparities below the width of the pictures",
    "size": "the left and right pictures have different or tiny sizes",
    "no_pose": "the log has no odometry or absolute poses at the stamps of the images",
}
WAIT_FOR_ODOMETRY_NS = 2_000_000_000  # without any odometry for this long the motion is visual


class PoseTrack:
    """Tracks the robot's pose; subclasses decide how a frame is used and at which stamps poses are recorded."""

    def __init__(self, config: StereoBayesConfig, seed: int) -> None:
        self._config = config
        self._pose = RobotPose(config)
        self._frames = FrameBuilder(config)
        self._waiting: deque[StereoPair | Disparity] = deque()
        self._stamps: list[int] = []
        self._beliefs: list[PoseBelief] = []
        self._counters: Counter[str] = Counter()
        self._stopwatch = Stopwatch()

    @property
    def estimate(self) -> Estimate | None:
        """The pose of the last record."""
        if not self._beliefs:
            return None
        return Estimate(self._stamps[-1], self._beliefs[-1].pose)

    @property
    def timings_s(self) -> Mapping[str, float]:
        """Seconds spent in each stage so far."""
        return self._stopwatch.seconds

    def process(self, event: Event) -> None:
        """Odometry, absolute poses, stereo pairs or disparities, and the geometry of the head are used."""
        if isinstance(event, Odometry):
            self._pose.add_odometry(event)
            self._on_odometry(event.stamp_ns)
        elif isinstance(event, AbsolutePose):
            self._pose.add_absolute_pose(event)
        elif isinstance(event, CameraInfo):
            self._frames.add_info(event)
        elif isinstance(event, Transform):
            if event.is_static:
                self._frames.add_extrinsics(event)
        elif isinstance(event, StereoPair | Disparity):
            self._waiting.append(event)
            if len(self._waiting) > MAX_WAITING:
                self._skip(self._waiting.popleft(), "no_pose")
        self._process_waiting(is_last=False)

    def _finish(self) -> None:
        self._pose.start()
        self._process_waiting(is_last=True)
        while self._waiting:
            self._skip(self._waiting.popleft(), "no_pose")

    def _require_frames(self) -> None:
        """Raise MethodError if the log has images and none of them could be used."""
        skipped = {
            key.split(".")[2]: n
            for key, n in sorted(self._all_counters().items())
            if key.startswith(SKIPPED_IMAGES)
        }
        if self._stamps or not skipped:
            return
        reasons = ", ".join(f"{n} x {reason.replace('_', ' ')}" for reason, n in skipped.items())
        advice = next((text for reason, text in ADVICE.items() if reason in skipped), "see report.json")
        raise MethodError(f"no stereo pair or disparity image could be used ({reasons}): {advice}")

    def _on_odometry(self, stamp_ns: int) -> None:
        """Called after each odometry message."""

    def _use(self, frame: StereoFrame, belief: PoseBelief) -> None:
        """Called with each frame and the robot's pose at its stamp."""

    def _process_waiting(self, is_last: bool) -> None:
        """Use the images up to which the motion is known; all of them if no more events follow."""
        while self._waiting:
            image = self._waiting[0]
            if self._pose.is_visual is None:
                newest = self._waiting[-1].stamp_ns
                if not is_last and newest - image.stamp_ns < WAIT_FOR_ODOMETRY_NS:
                    return
                self._pose.is_visual = True
            if not self._pose.is_visual and not self._pose.is_known_at(image.stamp_ns) and not is_last:
                return
            self._waiting.popleft()
            frame = self._frame(image)
            if frame is None:
                continue
            if self._pose.is_visual:
                self._pose.add_step(frame.stamp_ns, frame.step)
                self._pose.start()
            belief = self._pose.at(frame.stamp_ns)
            if belief is None:
                self._skip(image, "no_pose")
                continue
            self._use(frame, belief)

    def _frame(self, image: StereoPair | Disparity) -> StereoFrame | None:
        with self._stopwatch.stage("disparity"):
            if isinstance(image, Disparity):
                if self._pose.is_visual:
                    self._skip(image, "no_motion")
                    return None
                return self._frames.of_disparity(image)
            return self._frames.of_pair(image, bool(self._pose.is_visual))

    def _record(self, stamp_ns: int, belief: PoseBelief) -> None:
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
    """`gridslam map`: the pose filter, and a map from the frames of the stereo head."""

    def __init__(self, config: StereoBayesConfig, seed: int) -> None:
        super().__init__(config, seed)
        self._map = BeliefMap(config)
        self._rays = RayReader(config, self._counters)
        self._r0: list[float] = []

    def result(self) -> RunResult:
        """The map, the poses of the frames, the obstacles, and the standard deviations of the pose."""
        self._finish()
        self._require_frames()
        occupancy = self._map.occupancy()
        stamps = np.array(self._stamps, np.int64)
        series = self._series()
        if self._config.advanced.correlation.mode == "adaptive":
            series["correlation"] = Series(stamps, np.array(self._r0), "")
        return RunResult(
            self._trajectory(),
            occupancy,
            position_std=series["position_deviation"],
            layers={"probability": self._map.layer()},
            tables={"obstacles": self._obstacles(occupancy)},
            series=series,
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
            measures={
                "correlation_r0": self._map.correlation.r0,
                "stereo_row_offset_px": self._frames.row_offsets_px,
                "stereo_rectified_from_raw": self._frames.is_rectified_here,
            },
            notes=self._frames.notes,
        )

    def _use(self, frame: StereoFrame, belief: PoseBelief) -> None:
        with self._stopwatch.stage("observe"):
            rays = self._rays.read(frame.disparity, frame.head)
        with self._stopwatch.stage("map"):
            covariance = belief.covariance if self._pose.is_absolute else np.zeros((3, 3))
            self._map.update(
                belief.pose, covariance, rays, self._map.noise(float(self._config.disparity.disparities))
            )
        self._r0.append(self._map.correlation.r0)
        self._record(frame.stamp_ns, belief)

    def _obstacles(self, occupancy: OccupancyGrid) -> Table:
        if not occupancy.probability.size:
            return Table(ObstacleRegion.columns(), [])
        regions = obstacle_regions(occupancy, self._config.robot_radius_m)
        return Table(ObstacleRegion.columns(), [region.row() for region in regions])


class StereoBayesPose(PoseTrack):
    """`gridslam localize`: the pose filter alone; a pose per odometry message, or per frame with visual odometry."""

    def __init__(self, config: StereoBayesConfig, seed: int, occupancy: OccupancyGrid | None = None) -> None:
        super().__init__(config, seed)
        self._odometry_ns: deque[int] = deque()

    def result(self) -> RunResult:
        """The poses and their standard deviations."""
        self._finish()
        self._record_before(float("inf"))
        series = self._series()
        return RunResult(
            self._trajectory(),
            series=series,
            position_std=series["position_deviation"],
            counters=self._all_counters(),
            timings_s=dict(self._stopwatch.seconds),
            notes=self._frames.notes,
        )

    def _on_odometry(self, stamp_ns: int) -> None:
        """Record the poses that are old enough for late absolute poses to have arrived."""
        if not self._pose.is_visual:
            self._odometry_ns.append(stamp_ns)
            self._record_before(stamp_ns - 0.5 * WINDOW_NS)

    def _record_before(self, before_ns: float) -> None:
        while self._odometry_ns and self._odometry_ns[0] < before_ns:
            stamp = self._odometry_ns.popleft()
            belief = self._pose.at(stamp)
            if belief is not None:
                self._record(stamp, belief)

    def _frame(self, image: StereoPair | Disparity) -> StereoFrame | None:
        return super()._frame(image) if self._pose.is_visual else None

    def _use(self, frame: StereoFrame, belief: PoseBelief) -> None:
        self._record(frame.stamp_ns, belief)
