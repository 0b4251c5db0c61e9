"""The robot in the drawing, update by update: Monte Carlo localization, line observation, motion correction."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.drawing import DrawnMap
from gridslam.matching.lines import Segments, ransac_lines
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.line_front_end import moved
from gridslam.methods.handmap_slam.line_observation import (
    LineObserver,
    ObservedLine,
    correction_of,
    families_observed,
)
from gridslam.methods.handmap_slam.localizer import DrawingLocalizer, DrawnBelief
from gridslam.methods.handmap_slam.places import Been, Places

Floats = NDArray[np.float64]

LEAST_POINTS = 10


@dataclass(frozen=True, slots=True)
class Update:
    """What one update came to: the pose, its scan's row in the track, and the drawn lines in view."""

    row: int
    pose: DrawingPose
    lines: tuple[ObservedLine, ...]


class DrawingTracker:
    """Follows the robot in the drawing; `pose` is None until a scan with points has come."""

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
        self._localizer = DrawingLocalizer(config, drawn, rng)
        self._line_rng = line_rng
        self._updated_at: Floats | None = None  # the front end's pose at the last update
        self._at_update: DrawingPose | None = None
        self._unobserved = 0
        self._travelled_m = 0.0
        self._been = Places(config.localization.recall_m)
        self.pose: DrawingPose | None = None
        self.updates: list[Update] = []
        self.counters: Counter[str] = Counter()

    @property
    def states(self) -> Floats:
        """The particles `(n, 5)`."""
        return self._localizer.states

    def lines_of(self, scan: PreparedScan) -> Segments:
        """The scan's lines in the robot's frame."""
        config = self._config.lines
        return ransac_lines(
            scan.points,
            config.tolerance_m,
            config.least_points,
            config.most_lines,
            config.hypotheses,
            self._line_rng,
            config.gap_m,
        )

    def take(
        self,
        scan: PreparedScan,
        track_pose: Floats,
        row: int,
        beam_ends: Floats,
        lines: Segments | None = None,
    ) -> None:
        """Follow the robot to the front end's pose `(3,)`; weigh with the scan when it has come far enough.

        `beam_ends` `(m, 2)` tell how far the scan's beams went, those without return included (robot's frame, m); `lines` are
        the scan's, if they are known already.
        """
        if self._updated_at is None or self._at_update is None:
            if len(scan.points) >= LEAST_POINTS:
                self._tell(self._localizer.start(scan.points), scan, track_pose, row, beam_ends, lines)
            return
        step = se2.between(self._updated_at, track_pose)
        settings = self._config.localization
        far = (
            float(np.hypot(step[0], step[1])) >= settings.update_m
            or abs(float(step[2])) >= settings.update_rad
        )
        if not far:
            self.pose = moved(self._at_update, step, scan.stamp_ns)
            return
        self._localizer.move(step)
        self._travelled_m += float(np.hypot(step[0], step[1]))
        self._recall(track_pose)
        if len(scan.points) < LEAST_POINTS:
            self.counters["drawing.scan_without_points"] += 1
            self._updated_at = track_pose.copy()
            self._at_update = self.pose = moved(self._at_update, step, scan.stamp_ns)
            return
        self._tell(self._localizer.weigh(scan.points), scan, track_pose, row, beam_ends, lines)

    def _tell(
        self,
        belief: DrawnBelief,
        scan: PreparedScan,
        track_pose: Floats,
        row: int,
        beam_ends: Floats,
        lines: Segments | None,
    ) -> None:
        """Take the belief as the pose, observe the drawn lines from there, and correct."""
        pose = _pose_of(belief, scan.stamp_ns)
        observed = self._observer.observe(self.lines_of(scan) if lines is None else lines, beam_ends, pose)
        self._count(observed)
        if self._config.correction:
            pose = self._corrected(pose, observed)
        self._updated_at = track_pose.copy()
        self._at_update = self.pose = pose
        self.updates.append(Update(row, pose, tuple(observed)))
        self._been.add(Been(track_pose.copy(), self._travelled_m, pose))
        self.counters["drawing.updates"] += 1

    def _recall(self, track_pose: Floats) -> None:
        """Where the robot has been before it should be found in the drawing as before: a bent drawing stays bent."""
        settings = self._config.localization
        if not settings.recall_share:
            return
        before_m = self._travelled_m - settings.recall_after_m
        near = [
            been for been in self._been.near(track_pose, settings.recall_m) if been.travelled_m < before_m
        ]
        if near:
            best = max(near, key=lambda been: been.pose.fit)
            then = moved(best.pose, se2.between(best.track_pose, track_pose))
            scales = np.log([then.scale_x, then.scale_y])
            self._localizer.recall(np.array([then.x_m, then.y_m, then.yaw_rad, *scales]))
            self.counters["drawing.recalls"] += 1

    def _corrected(self, pose: DrawingPose, observed: list[ObservedLine]) -> DrawingPose:
        """Shift the belief by a step along the unobserved axis, once it has been unobserved for some updates."""
        config = self._config.lines
        step = correction_of(observed, config.threshold, config.step_m)
        self._unobserved = self._unobserved + 1 if step.any() else 0
        if self._unobserved < config.patience:
            return pose
        offset = step * (pose.scale_x, pose.scale_y)
        self._localizer.shift(offset)
        self.counters["drawing.corrections"] += 1
        return DrawingPose(
            pose.stamp_ns,
            pose.x_m + float(offset[0]),
            pose.y_m + float(offset[1]),
            pose.yaw_rad,
            pose.scale_x,
            pose.scale_y,
            pose.spread_m,
            pose.fit,
        )

    def _count(self, observed: list[ObservedLine]) -> None:
        families = families_observed(observed, self._config.lines.threshold)
        for family, is_observed in families.items():
            self.counters[f"lines.{family}.{'observed' if is_observed else 'unobserved'}"] += 1


def _pose_of(belief: DrawnBelief, stamp_ns: int) -> DrawingPose:
    x, y, yaw, log_x, log_y = belief.state.tolist()
    spread = float(np.hypot(belief.deviations[0], belief.deviations[1]))
    return DrawingPose(stamp_ns, x, y, yaw, float(np.exp(log_x)), float(np.exp(log_y)), spread, belief.fit)
