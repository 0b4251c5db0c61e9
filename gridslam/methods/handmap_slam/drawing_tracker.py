"""The robot's pose in the drawing, update by update: Monte Carlo localization, line observation, motion correction."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.matching.lines import LineSegments, ransac_lines
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.visited_poses import VisitedPose, VisitedPoses
from gridslam.methods.handmap_slam.line_observation import (
    LineObserver,
    ObservedLine,
    correction_of,
    families_observed,
)
from gridslam.methods.handmap_slam.localizer import DrawingBelief, DrawingLocalizer
from gridslam.methods.handmap_slam.place_localizer import PlaceLocalizer

Floats = NDArray[np.float64]

MIN_POINTS = 10  # smallest number of points of a scan that updates the particles
UPDATE_M, UPDATE_RAD = 0.2, 0.15  # motion after which a scan updates the particles
REVISIT_RADIUS_M = 1.0  # an earlier pose this close is the same place
REVISIT_AFTER_M = 4.0  # distance to travel before a place counts as revisited
CORRECTION_STEP_M = 0.25  # step of the position along the unobserved axis, in metres of the world
CORRECTION_PATIENCE = 3  # consecutive updates without observation before the first correction

# Lines of a scan, found by RANSAC.
LINE_TOLERANCE_M = 0.03
LINE_MIN_POINTS = 12
MAX_LINES = 8
LINE_HYPOTHESES = 80  # draws for each line
LINE_MAX_GAP_M = 3.0  # a line ends where it has no point for this distance


@dataclass(frozen=True, slots=True)
class DrawingUpdate:
    """The result of one update: the scan's row in the track, the pose, and the drawn lines in view."""

    row: int
    pose: DrawingPose
    lines: tuple[ObservedLine, ...]


@dataclass(frozen=True, slots=True)
class TrackedScan:
    """A scan with the front end's pose `(3,)`, its row in the track, and the endpoints `(m, 2)` of its beams.

    The endpoints (robot's frame, m) include those of beams without return.
    """

    scan: PreparedScan
    track_pose: Floats
    row: int
    endpoints: Floats


class DrawingTracker:
    """Tracks the robot in the drawing; `pose` is None until a scan with points has arrived."""

    def __init__(
        self,
        config: HandmapSlamConfig,
        drawn: DrawnMap,
        observer: LineObserver,
        rng: np.random.Generator,
        line_rng: np.random.Generator,
    ) -> None:
        self._config = config
        self._observer = observer
        self._localizer = localizer_of(config, drawn, rng)
        self._line_rng = line_rng
        self._track_pose_at_update: Floats | None = None  # the front end's pose at the last update
        self._pose_at_update: DrawingPose | None = None
        self._unobserved_updates = 0
        self._travelled_m = 0.0
        self._visited = VisitedPoses(REVISIT_RADIUS_M)
        self.pose: DrawingPose | None = None
        self.updates: list[DrawingUpdate] = []
        self.counters: Counter[str] = Counter()

    @property
    def states(self) -> Floats:
        """The particles `(n, 5)`."""
        return self._localizer.states

    def lines_of(self, scan: PreparedScan) -> LineSegments:
        """The scan's lines in the robot's frame."""
        return ransac_lines(
            scan.points,
            LINE_TOLERANCE_M,
            LINE_MIN_POINTS,
            MAX_LINES,
            LINE_HYPOTHESES,
            rng=self._line_rng,
            gap_m=LINE_MAX_GAP_M,
        )

    def add_scan(self, tracked: TrackedScan, lines: LineSegments | None = None) -> None:
        """Move the pose along with the front end, and update the particles if the robot has moved far enough.

        `lines` are the scan's lines, if they are known already.
        """
        scan = tracked.scan
        if self._track_pose_at_update is None or self._pose_at_update is None:
            if len(scan.points) >= MIN_POINTS:
                self._finish_update(self._localizer.start(scan.points), tracked, lines)
            return
        step = se2.between(self._track_pose_at_update, tracked.track_pose)
        distance_m = float(np.hypot(step[0], step[1]))
        if distance_m < UPDATE_M and abs(float(step[2])) < UPDATE_RAD:
            self.pose = self._pose_at_update.after(step, scan.stamp_ns)
            return
        self._localizer.predict(step)
        self._travelled_m += distance_m
        self._use_revisited_pose(tracked.track_pose)
        if len(scan.points) < MIN_POINTS:
            self.counters["drawing.scan_without_points"] += 1
            self._track_pose_at_update = tracked.track_pose.copy()
            self._pose_at_update = self.pose = self._pose_at_update.after(step, scan.stamp_ns)
            return
        self._finish_update(self._localizer.update(scan.points), tracked, lines)

    def _finish_update(self, belief: DrawingBelief, tracked: TrackedScan, lines: LineSegments | None) -> None:
        """Take the pose from the belief, observe the drawn lines from there, and correct the pose."""
        pose = _pose_of(belief, tracked.scan.stamp_ns)
        if lines is None:
            lines = self.lines_of(tracked.scan)
        observed = self._observer.observe(lines, tracked.endpoints, pose)
        for family, is_observed in families_observed(observed).items():
            self.counters[f"lines.{family}.{'observed' if is_observed else 'unobserved'}"] += 1
        if self._config.correction:
            pose = self._corrected(pose, observed)
        self._track_pose_at_update = tracked.track_pose.copy()
        self._pose_at_update = self.pose = pose
        self.updates.append(DrawingUpdate(tracked.row, pose, tuple(observed)))
        self._visited.add(VisitedPose(tracked.track_pose.copy(), self._travelled_m, pose))
        self.counters["drawing.updates"] += 1

    def _use_revisited_pose(self, track_pose: Floats) -> None:
        """Place particles at the earlier pose in the drawing when the robot returns to a place.

        A deformed drawing is deformed in the same way on the second visit.
        """
        localizer = self._localizer
        if isinstance(localizer, PlaceLocalizer) or not self._config.advanced.revisit_fraction:
            return
        before_m = self._travelled_m - REVISIT_AFTER_M
        earlier = [
            visited
            for visited in self._visited.near(track_pose, REVISIT_RADIUS_M)
            if visited.travelled_m < before_m
        ]
        if earlier:
            best = max(earlier, key=lambda visited: visited.pose.inlier_ratio)
            pose = best.pose.after(se2.between(best.track_pose, track_pose))
            scales = np.log([pose.scale_x, pose.scale_y])
            localizer.place_particles(np.array([pose.x, pose.y, pose.yaw_rad, *scales]))
            self.counters["drawing.revisits"] += 1

    def _corrected(self, pose: DrawingPose, observed: list[ObservedLine]) -> DrawingPose:
        """The pose shifted along the unobserved axis, if that has been unobserved for some updates."""
        step = correction_of(observed, CORRECTION_STEP_M)
        self._unobserved_updates = self._unobserved_updates + 1 if step.any() else 0
        if self._unobserved_updates < CORRECTION_PATIENCE:
            return pose
        offset = step * (pose.scale_x, pose.scale_y)
        self._localizer.shift(offset)
        self.counters["drawing.corrections"] += 1
        return replace(pose, x=pose.x + float(offset[0]), y=pose.y + float(offset[1]))


def localizer_of(
    config: HandmapSlamConfig, drawn: DrawnMap, rng: np.random.Generator
) -> DrawingLocalizer | PlaceLocalizer:
    """The localizer over places; that of the paper for its front end, and for one scale along both axes."""
    if config.front_end == "surfaces" and config.localization.separate_scales:
        return PlaceLocalizer(config, drawn, rng)
    return DrawingLocalizer(config, drawn, rng)


def _pose_of(belief: DrawingBelief, stamp_ns: int) -> DrawingPose:
    x, y, yaw, log_x, log_y = belief.state.tolist()
    return DrawingPose(
        stamp_ns,
        x,
        y,
        yaw,
        scale_x=float(np.exp(log_x)),
        scale_y=float(np.exp(log_y)),
        position_std=float(np.hypot(belief.std[0], belief.std[1])),
        inlier_ratio=belief.inlier_ratio,
    )
