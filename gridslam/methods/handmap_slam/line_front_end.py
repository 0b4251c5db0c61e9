"""The paper's own tracking (section 6.2): rotation from lines, translation by point-to-plane ICP on the former scan."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.front_end import (
    MAX_CORRESPONDENCE_M,
    MIN_CORRESPONDENCES,
    SIGMA_M,
    ScanMatch,
)
from gridslam.lidar_slam.odometry_noise import odometry_std
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.matching.icp import point_to_plane
from gridslam.matching.lines import Segments, difference_modulo_pi
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.line_observation import LineObserver

Floats = NDArray[np.float64]

FIELD_POINTS = 90
FIELD_YAW_RAD = np.linspace(-0.1, 0.1, 41)
FIELD_SHIFTS_M = np.linspace(-0.3, 0.3, 5)
MOST_TURN_RAD = 0.05  # that the drawing adds to the heading at one scan: it is bent, the robot's way is not
FIELD_GAIN = 0.2  # share of the field's turn that is taken, the former scan having its say as well
FAR_LINE_M = 1.5  # a line of the scan corresponds to no drawn line farther away (metres of the world)


class LineFrontEnd:
    """Tracks from key scan to key scan; its heading is that of the drawing's lines."""

    def __init__(
        self, config: HandmapSlamConfig, observer: LineObserver, likelihood: DrawnLikelihood
    ) -> None:
        self._config = config
        self._observer = observer
        self._likelihood = likelihood
        self._former: PreparedScan | None = None
        self._former_pose = np.zeros(3)
        self._odometry: Floats | None = None
        self._step = np.zeros(3)
        self._heading_offset: float | None = None  # drawing's heading minus the map's
        self.pose = np.zeros(3)
        self.lines = Segments.none()  # those of the present scan, in the robot's frame
        self.drawing_pose: DrawingPose | None = None  # at the scan before, to be set by who knows it

    def track(self, scan: PreparedScan, odometry: Floats, odometry_jumped: bool = False) -> ScanMatch:
        """The pose at the scan, given T_odom_base `(3,)` at its stamp; the first scan is at the origin."""
        if self._odometry is None or self._former is None:
            self._odometry = odometry
            return ScanMatch(self.pose, 1.0, True)
        step = se2.between(self._odometry, odometry)
        deviations = odometry_std(step, self._step, self._config.odometry)
        self._odometry, self._step = odometry, step
        predicted = se2.compose(self.pose, step)
        turn, by_lines = self._turn_from_drawing(scan, predicted, step)
        predicted[2] = float(se2.wrap_angle(predicted[2] + turn))
        found = point_to_plane(
            scan.points,
            self._former.points,
            self._former.normals,
            se2.between(self._former_pose, predicted),
            MAX_CORRESPONDENCE_M,
            SIGMA_M,
            np.diag(1.0 / deviations**2),
            solve_yaw=not by_lines,
        )
        is_matched = found.matches >= MIN_CORRESPONDENCES
        self.pose = np.asarray(se2.compose(self._former_pose, found.pose)) if is_matched else predicted
        return ScanMatch(self.pose, found.matches / max(len(scan.points), 1), is_matched)

    def add_key_scan(self, scan: PreparedScan) -> None:
        """The scan at the present pose is the one that the next ones are registered to."""
        self._former, self._former_pose = scan, self.pose.copy()

    def _turn_from_drawing(self, scan: PreparedScan, predicted: Floats, step: Floats) -> tuple[float, bool]:
        """What the heading lacks by the drawing, and whether lines say so.

        Where the scan has no lines (curved walls) the drawing's distance field gives the turn, and the former scan the rest.
        """
        before = self.drawing_pose
        if before is None:
            return 0.0, False
        if self._heading_offset is None:
            self._heading_offset = before.yaw_rad - float(self.pose[2])
        ahead = moved(before, step)
        at = DrawingPose(
            ahead.stamp_ns,
            ahead.x_m,
            ahead.y_m,
            float(se2.wrap_angle(self._heading_offset + predicted[2])),
            ahead.scale_x,
            ahead.scale_y,
            ahead.spread_m,
            ahead.fit,
        )
        config = self._config.lines
        turn = line_turn(
            self.lines.longer_than(config.turn_length_m), at, self._observer, config.parallel_rad
        )
        if turn is not None:
            return float(np.clip(turn, -MOST_TURN_RAD, MOST_TURN_RAD)), True
        return FIELD_GAIN * self._field_turn(scan, at), False

    def _field_turn(self, scan: PreparedScan, at: DrawingPose) -> float:
        """The turn with which the scan fits the drawing's distance field best, for curved walls that have no lines."""
        points = scan.subset(FIELD_POINTS)[0]
        if len(points) < MIN_CORRESPONDENCES:
            return 0.0
        turn, dx, dy = (
            g.ravel() for g in np.meshgrid(FIELD_YAW_RAD, FIELD_SHIFTS_M, FIELD_SHIFTS_M, indexing="ij")
        )
        states = np.column_stack(
            [
                at.x_m + at.scale_x * dx,
                at.y_m + at.scale_y * dy,
                at.yaw_rad + turn,
                np.full(len(turn), np.log(at.scale_x)),
                np.full(len(turn), np.log(at.scale_y)),
            ]
        )
        scores = self._config.localization.point_weight * self._likelihood.log_likelihood(points, states)
        weights = np.exp(scores - scores.max())
        return float(weights @ turn / weights.sum())


def line_turn(lines: Segments, at: DrawingPose, observer: LineObserver, parallel_rad: float) -> float | None:
    """theta = 1/M sum (theta_k - theta_i), angles modulo pi, over the scan's lines and the drawn ones that correspond.

    Correspondence through the scan simulated in the drawing at the pose `at`: of the drawn lines that it sees, the nearest with
    about the same direction. None without any.
    """
    if not len(lines) or not len(observer.lines):
        return None
    seen = np.unique(observer.visible(at)[0])
    seen = seen[seen >= 0]
    if not len(seen):
        return None
    drawn = Segments(observer.lines.starts[seen], observer.lines.ends[seen])
    scale = (at.scale_x * at.scale_y) ** 0.5
    # Directions are compared before the drawing's stretching, which turns all but those along its axes.
    unstretched = Segments(at.from_drawing(drawn.starts), at.from_drawing(drawn.ends))
    distance = drawn.distances_to(at.to_drawing(0.5 * (lines.starts + lines.ends))) / scale
    off = difference_modulo_pi(unstretched.directions_rad[None, :], lines.directions_rad[:, None])
    distance = np.where(np.abs(off) < parallel_rad, distance, np.inf)
    nearest = distance.argmin(axis=1)
    rows = np.flatnonzero(distance.min(axis=1) < FAR_LINE_M)
    return float(off[rows, nearest[rows]].mean()) if len(rows) else None


def moved(pose: DrawingPose, step: Floats, stamp_ns: int | None = None) -> DrawingPose:
    """The pose in the drawing after a motion `(3,)` of the robot in metres."""
    x, y = pose.to_drawing(step[None, :2])[0].tolist()
    yaw = float(se2.wrap_angle(pose.yaw_rad + step[2]))
    stamp = pose.stamp_ns if stamp_ns is None else stamp_ns
    return DrawingPose(stamp, x, y, yaw, pose.scale_x, pose.scale_y, pose.spread_m, pose.fit)
