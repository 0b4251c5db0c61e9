"""stereo-bayes: an occupancy map from stereo (`map`), and the pose filter alone (`localize`)."""

from __future__ import annotations

from collections import deque

import numpy as np

from gridslam.core.messages import Disparity, StereoPair
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import RunResult, Series, Table
from gridslam.methods.stereo_bayes.belief import BeliefMap
from gridslam.methods.stereo_bayes.config import StereoBayesConfig
from gridslam.methods.stereo_bayes.frames import StereoFrame
from gridslam.methods.stereo_bayes.pose import WINDOW_NS
from gridslam.methods.stereo_bayes.pose_track import PoseTrack
from gridslam.methods.stereo_bayes.rays import RayReader
from gridslam.motion.absolute_pose_filter import PoseBelief
from gridslam.planning.obstacles import ObstacleRegion, obstacle_regions


class StereoBayes(PoseTrack):
    """`gridslam map`: the pose filter, and a map from the frames of the stereo head."""

    def __init__(self, config: StereoBayesConfig, seed: int) -> None:
        super().__init__(config)
        self._map = BeliefMap(config)
        self._noise = self._map.noise(float(config.disparity.disparities))
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
            self._map.update(belief.pose, covariance, rays, self._noise)
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
        super().__init__(config)
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
