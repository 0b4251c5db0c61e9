"""Extrinsics of a lidar from the motions of the robot and of the lidar, for logs that lack them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Transform

Floats = NDArray[np.float64]

MIN_YAW_RAD = 0.15  # less is left to the matching: drift and slipping wheels look alike
MAX_DISTANCE_M = 2.0  # largest distance from the robot's centre: farther is no place on a robot
# Largest deviation of (cos, sin) from length 1, which they have if both motions are of one body
MAX_SCALE_ERROR = 0.3
MAX_ERROR_RATIO = 0.5  # largest ratio of the motions' difference with the place found to that without it
ERROR_FLOOR_M = 0.02


def solve_mount(moved: Floats, matched: Floats) -> Floats | None:
    """T_base_laser `(3,)` from motions `(n, 3)` of the base and of the lidar over the same times.

    None where the lidar looks forward, or where the motions give no clear place. It holds T_moved T_base_laser = T_base_laser
    T_matched; this is linear in the place and in the cosine and sine of the yaw.
    """
    c, s = np.cos(moved[:, 2]), np.sin(moved[:, 2])
    mx, my = matched[:, 0], matched[:, 1]
    x_rows = np.column_stack([mx, -my, 1.0 - c, s])
    y_rows = np.column_stack([my, mx, -s, 1.0 - c])
    (cos, sin, x, y), *_ = np.linalg.lstsq(
        np.vstack([x_rows, y_rows]), np.concatenate([moved[:, 0], moved[:, 1]]), rcond=None
    )
    mount = np.array([x, y, math.atan2(sin, cos)])
    if abs(mount[2]) < MIN_YAW_RAD or abs(math.hypot(cos, sin) - 1.0) > MAX_SCALE_ERROR:
        return None
    if math.hypot(x, y) > MAX_DISTANCE_M:
        return None
    expected = se2.compose(mount, se2.compose(matched, np.broadcast_to(se2.inverse(mount), matched.shape)))
    error_m, error_before_m = (
        float(np.hypot(*(motion - moved)[:, :2].T).mean()) + ERROR_FLOOR_M for motion in (expected, matched)
    )
    return mount if error_m < MAX_ERROR_RATIO * error_before_m else None


def assumed_mount(events: list[Event], frame_id: str) -> Transform | None:
    """The static transform of a lidar without extrinsics: at the robot's centre, facing forward."""
    for event in events:
        if isinstance(event, Transform) and event.is_static and event.child_frame_id == frame_id:
            says_nothing = event.translation_m[:2] == (0.0, 0.0) and event.quat_wxyz == (1.0, 0.0, 0.0, 0.0)
            return event if says_nothing else None
    return None


def with_mount(transform: Transform, mount: Floats, frame_id: str) -> Transform:
    """The static transform with the lidar at `mount` `(3,)` in the frame of the base."""
    x, y, yaw = mount.tolist()
    return Transform(
        transform.stamp_ns,
        frame_id,
        transform.child_frame_id,
        (x, y, transform.translation_m[2]),
        (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)),
        is_static=True,
    )


def mount_note(transform: Transform) -> str:
    """One line for people."""
    (x, y, _), (w, _, _, z) = transform.translation_m, transform.quat_wxyz
    yaw_deg = math.degrees(2.0 * math.atan2(z, w))
    lidar = transform.child_frame_id
    return (
        f"{lidar} is placed on {transform.frame_id} by its motion: x {x:.2f} m, y {y:.2f} m, yaw {yaw_deg:.1f} deg; "
        f"log.extrinsics.{lidar} sets another place"
    )


def misplaced_note(lidar: str, moved: Floats) -> str:
    """One line about a lidar that by its motion sits at `moved` `(3,)` seen from where the log places it."""
    x, y, yaw = moved.tolist()
    return (
        f"by its motion {lidar} is not where the log places it, but turned by {math.degrees(yaw):.0f} deg and moved "
        f"by x {x:.2f} m, y {y:.2f} m of the base: check its transform, or set log.extrinsics.{lidar}"
    )
