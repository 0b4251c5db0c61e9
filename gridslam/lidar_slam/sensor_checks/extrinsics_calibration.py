"""Finds the extrinsics of a lidar from the motions of the robot and of the lidar, for logs that lack them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.lidar_slam.sensor_checks.motion_windows import MotionWindows
from gridslam.lidar_slam.sensor_checks.odometry_correction import OdometryCorrection

Floats = NDArray[np.float64]

# Smallest yaw and offset of a lidar that is placed: less is left to the matching, since drift and slipping wheels look alike
MIN_YAW_RAD, MIN_OFFSET_M = 0.15, 0.25
EXACT_M, EXACT_RAD = 0.05, 0.05  # errors of an offset and a yaw that are found by motion
MAX_DISTANCE_M = 2.0  # largest distance from the robot's centre: farther is not on a robot
# Largest deviation of (cos, sin) from length 1, which they have if both motions are of one body
MAX_SCALE_ERROR = 0.3
MAX_ERROR_RATIO = 0.5  # largest ratio of the motions' difference with the place found to that without it
# Largest difference of the rotations, relative and at least: on one body they are the same wherever the lidar sits
MAX_ROTATION_ERROR, ROTATION_FLOOR_RAD = 0.3, 0.03
ERROR_FLOOR_M = 0.02


@dataclass(frozen=True, slots=True)
class ExtrinsicsCheck:
    """The extrinsics of the only lidar of a log, found by its motion; None if those of the log are right.

    `is_misplaced`: the log has other extrinsics.
    """

    corrected: Transform | None = None
    is_misplaced: bool = False

    @property
    def notes(self) -> list[str]:
        """A line about corrected extrinsics, if any."""
        return [] if self.corrected is None else [extrinsics_note(self.corrected, self.is_misplaced)]

    def applied_to(self, event: Event) -> Event:
        """The transform of the lidar with the corrected extrinsics; other events unchanged."""
        if self.corrected is None or not isinstance(event, Transform):
            return event
        return self.corrected if event.child_frame_id == self.corrected.child_frame_id else event


def find_extrinsics(
    events: list[Event], windows: MotionWindows | None, correction: OdometryCorrection
) -> ExtrinsicsCheck:
    """Extrinsics of the only lidar among the events, if the log has none, or clearly wrong ones.

    `windows` are motions of the odometry and of the lidar. It may be the odometry as well that tracks another frame; the map is
    the same.
    """
    frames = {e.frame_id for e in events if isinstance(e, LaserScan)}
    if (
        len(frames) != 1
        or windows is None
        or (found := solve_extrinsics(*windows.motions(correction))) is None
    ):
        return ExtrinsicsCheck()
    lidar = next(iter(frames))
    assumed = assumed_extrinsics(events, lidar)
    if assumed is not None:
        base = next(e.child_frame_id for e in events if isinstance(e, Odometry))
        return ExtrinsicsCheck(with_extrinsics(assumed, found, base))
    stated = next((e for e in events if isinstance(e, Transform) and e.child_frame_id == lidar), None)
    if stated is None or not stated.is_static:
        return ExtrinsicsCheck()
    return ExtrinsicsCheck(moved_transform(stated, found), is_misplaced=True)


def moved_transform(stated: Transform, moved: Floats) -> Transform:
    """The sensor's extrinsics, corrected by `moved` `(3,)`: the pose of the base that they assume, in the true base frame.

    Of a rotation and an offset, one that is within the errors of both is none.
    """
    moved = moved * ([math.hypot(moved[0], moved[1]) >= EXACT_M] * 2 + [abs(moved[2]) >= EXACT_RAD])
    w, x, y, z = stated.quat_wxyz
    place = se2.transform_points(moved, np.array([stated.translation_m[:2]]))[0]
    cos, sin = math.cos(0.5 * moved[2]), math.sin(0.5 * moved[2])
    turned = (cos * w - sin * z, cos * x - sin * y, cos * y + sin * x, cos * z + sin * w)
    return replace(
        stated, translation_m=(float(place[0]), float(place[1]), stated.translation_m[2]), quat_wxyz=turned
    )


def solve_extrinsics(moved: Floats, matched: Floats) -> Floats | None:
    """T_base_laser `(3,)` from motions `(n, 3)` of the base and of the lidar over the same times.

    None if the lidar looks forward from near the centre, or if the motions do not determine the extrinsics. It holds
    T_moved T_base_laser = T_base_laser T_matched; this is linear in the place and in the cosine and sine of the yaw.
    """
    turned_rad, rotation_error_rad = (
        float(np.abs(se2.wrap_angle(rotations)).mean())
        for rotations in (matched[:, 2], moved[:, 2] - matched[:, 2])
    )
    if rotation_error_rad > max(ROTATION_FLOOR_RAD, MAX_ROTATION_ERROR * turned_rad):
        return None
    c, s = np.cos(moved[:, 2]), np.sin(moved[:, 2])
    mx, my = matched[:, 0], matched[:, 1]
    x_rows = np.column_stack([mx, -my, 1.0 - c, s])
    y_rows = np.column_stack([my, mx, -s, 1.0 - c])
    (cos, sin, x, y), *_ = np.linalg.lstsq(
        np.vstack([x_rows, y_rows]), np.concatenate([moved[:, 0], moved[:, 1]]), rcond=None
    )
    pose = np.array([x, y, math.atan2(sin, cos)])
    is_near = abs(pose[2]) < MIN_YAW_RAD and math.hypot(x, y) < MIN_OFFSET_M
    if is_near or abs(math.hypot(cos, sin) - 1.0) > MAX_SCALE_ERROR or math.hypot(x, y) > MAX_DISTANCE_M:
        return None
    expected = se2.compose(pose, se2.compose(matched, np.broadcast_to(se2.inverse(pose), matched.shape)))
    error_m, error_before_m = (
        float(np.hypot(*(motion - moved)[:, :2].T).mean()) + ERROR_FLOOR_M for motion in (expected, matched)
    )
    return pose if error_m < MAX_ERROR_RATIO * error_before_m else None


def assumed_extrinsics(events: list[Event], frame_id: str) -> Transform | None:
    """The static transform of a lidar without extrinsics: at the robot's centre, facing forward."""
    for event in events:
        if isinstance(event, Transform) and event.is_static and event.child_frame_id == frame_id:
            says_nothing = event.translation_m[:2] == (0.0, 0.0) and event.quat_wxyz == (1.0, 0.0, 0.0, 0.0)
            return event if says_nothing else None
    return None


def with_extrinsics(transform: Transform, pose: Floats, frame_id: str) -> Transform:
    """The static transform with the lidar at `pose` `(3,)` in the frame of the base."""
    x, y, yaw = pose.tolist()
    return Transform(
        transform.stamp_ns,
        frame_id,
        transform.child_frame_id,
        (x, y, transform.translation_m[2]),
        (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        is_static=True,
    )


def extrinsics_note(transform: Transform, is_misplaced: bool = False) -> str:
    """One line for the user."""
    (x, y, _), (w, _, _, z) = transform.translation_m, transform.quat_wxyz
    yaw_deg = math.degrees(2.0 * math.atan2(z, w))
    lidar = transform.child_frame_id
    instead = (
        ", not where its transform places it (or the odometry tracks another frame)" if is_misplaced else ""
    )
    return (
        f"{lidar} is placed on {transform.frame_id} by its motion: x {x:.2f} m, y {y:.2f} m, yaw {yaw_deg:.1f} deg{instead}; "
        f"log.extrinsics.{lidar} sets another place"
    )
