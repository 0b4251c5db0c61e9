"""The paper's tracking (section 6.2): heading from lines, translation by point-to-plane ICP to the previous key scan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.front_end import (
    MAX_CORRESPONDENCE_M,
    MIN_CORRESPONDENCES,
    SIGMA_M,
    ScanMatch,
)
from gridslam.lidar_slam.odometry_noise import NO_MIN_STD, odometry_std
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.matching.icp import point_to_plane
from gridslam.matching.lines import LineSegments, difference_modulo_pi
from gridslam.methods.handmap_slam.config import HandmapSlamConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawn_likelihood import DrawnLikelihood
from gridslam.methods.handmap_slam.line_observation import PARALLEL_RAD, LineObserver
from gridslam.methods.handmap_slam.localizer import POINT_WEIGHT

Floats = NDArray[np.float64]

MIN_LINE_M = 2.5  # shorter lines of the scan do not correct the heading: they may lie on curves
MAX_CORRECTION_RAD = 0.05  # largest correction of the heading at one scan, since the drawing may be deformed
# Between a line of the scan and the drawn line it corresponds to, metres of the world
MAX_LINE_DISTANCE_M = 1.5

# Search for the heading in the drawing's distance field, where the scan has no lines.
FIELD_POINTS = 90
FIELD_YAW_RAD = np.linspace(-0.1, 0.1, 41)
FIELD_SHIFTS_M = np.linspace(-0.3, 0.3, 5)
FIELD_GAIN = 0.2  # fraction of its correction that is applied; the previous scan provides the rest


class LineFrontEnd:
    """Tracks from key scan to key scan; the heading comes from the drawing's lines.

    Before each scan the caller sets `lines`, the scan's lines (robot's frame), and `drawing_pose`, the pose in the drawing at the
    previous scan.
    """

    def __init__(
        self, config: HandmapSlamConfig, observer: LineObserver, likelihood: DrawnLikelihood
    ) -> None:
        self._odometry_config = config.advanced.odometry
        self._observer = observer
        self._likelihood = likelihood
        self._reference: PreparedScan | None = None  # the last key scan
        self._reference_pose = np.zeros(3)
        self._odometry: Floats | None = None
        self._step = np.zeros(3)
        self._heading_offset: float | None = None  # heading in the drawing minus heading in the map
        self.pose = np.zeros(3)
        self.lines = LineSegments.none()
        self.drawing_pose: DrawingPose | None = None

    def track(self, scan: PreparedScan, odometry: Floats, min_std: Floats = NO_MIN_STD) -> ScanMatch:
        """The pose at the scan, given T_odom_base `(3,)` at its stamp; the first scan is at the origin.

        The odometry's motion since the last scan has standard deviations (x, y, yaw) of at least `min_std` `(3,)`.
        """
        if self._odometry is None or self._reference is None:
            self._odometry = odometry
            return ScanMatch(self.pose, 1.0, True)
        step = se2.between(self._odometry, odometry)
        std = odometry_std(step, self._step, self._odometry_config, min_std)
        self._odometry, self._step = odometry, step
        predicted = se2.compose(self.pose, step)
        correction, from_lines = self._heading_correction(scan, predicted, step)
        predicted[2] = float(se2.wrap_angle(predicted[2] + correction))
        found = point_to_plane(
            scan.points,
            self._reference.points,
            self._reference.normals,
            se2.between(self._reference_pose, predicted),
            MAX_CORRESPONDENCE_M,
            sigma_m=SIGMA_M,
            prior_information=np.diag(1.0 / std**2),
            solve_yaw=not from_lines,
        )
        is_matched = found.matches >= MIN_CORRESPONDENCES
        self.pose = np.asarray(se2.compose(self._reference_pose, found.pose)) if is_matched else predicted
        return ScanMatch(self.pose, found.matches / max(len(scan.points), 1), is_matched)

    def add_key_scan(self, scan: PreparedScan) -> None:
        """Make the scan at the current pose the one that the next scans are registered to."""
        self._reference, self._reference_pose = scan, self.pose.copy()

    def _heading_correction(self, scan: PreparedScan, predicted: Floats, step: Floats) -> tuple[float, bool]:
        """The correction (rad) of the predicted heading by the drawing, and whether it comes from lines.

        Where the scan has no lines (curved walls) it comes from the drawing's distance field.
        """
        before = self.drawing_pose
        if before is None:
            return 0.0, False
        if self._heading_offset is None:
            self._heading_offset = before.yaw_rad - float(self.pose[2])
        heading = float(se2.wrap_angle(self._heading_offset + predicted[2]))
        pose = replace(before.after(step), yaw_rad=heading)
        correction = heading_difference(self.lines.longer_than(MIN_LINE_M), pose, self._observer)
        if correction is not None:
            return float(np.clip(correction, -MAX_CORRECTION_RAD, MAX_CORRECTION_RAD)), True
        return FIELD_GAIN * self._field_correction(scan, pose), False

    def _field_correction(self, scan: PreparedScan, pose: DrawingPose) -> float:
        """The rotation (rad) that aligns the scan with the drawing's distance field, averaged over shifts by likelihood."""
        points = scan.subset(FIELD_POINTS)[0]
        if len(points) < MIN_CORRESPONDENCES:
            return 0.0
        rotation, dx, dy = (
            g.ravel() for g in np.meshgrid(FIELD_YAW_RAD, FIELD_SHIFTS_M, FIELD_SHIFTS_M, indexing="ij")
        )
        states = np.column_stack(
            [
                pose.x + pose.scale_x * dx,
                pose.y + pose.scale_y * dy,
                pose.yaw_rad + rotation,
                np.full(len(rotation), np.log(pose.scale_x)),
                np.full(len(rotation), np.log(pose.scale_y)),
            ]
        )
        scores = POINT_WEIGHT * self._likelihood.log_likelihood(points, states)
        weights = np.exp(scores - scores.max())
        return float(weights @ rotation / weights.sum())


def heading_difference(lines: LineSegments, pose: DrawingPose, observer: LineObserver) -> float | None:
    """theta = 1/M sum (theta_k - theta_i), angles modulo pi, over the scan's lines and the drawn lines they correspond to.

    A line corresponds to the nearest drawn line with about the same direction that a scan simulated at the pose meets.
    None if there are no correspondences.
    """
    if not len(lines) or not len(observer.lines):
        return None
    visible = np.unique(observer.visible(pose)[0])
    visible = visible[visible >= 0]
    if not len(visible):
        return None
    drawn = LineSegments(observer.lines.starts[visible], observer.lines.ends[visible])
    # Directions are compared before the drawing is stretched: stretching rotates all but those along its axes.
    unstretched = LineSegments(pose.from_drawing(drawn.starts), pose.from_drawing(drawn.ends))
    middles = pose.to_drawing(0.5 * (lines.starts + lines.ends))
    distance = drawn.distances_to(middles) / pose.mean_scale
    difference = difference_modulo_pi(unstretched.directions_rad[None, :], lines.directions_rad[:, None])
    distance = np.where(np.abs(difference) < PARALLEL_RAD, distance, np.inf)
    nearest = distance.argmin(axis=1)
    rows = np.flatnonzero(distance.min(axis=1) < MAX_LINE_DISTANCE_M)
    return float(difference[rows, nearest[rows]].mean()) if len(rows) else None
