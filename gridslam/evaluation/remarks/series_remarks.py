"""Remarks on one series of poses that looks wrong: stamps, orientations, motion out of the plane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import NS_PER_S
from gridslam.evaluation.readers.pose_series import PoseSeries

Floats = NDArray[np.float64]
TILTED_DEG, LEVEL_DEG = 20.0, 5.0  # median tilt of a series that is not planar, and of one that is
MIN_MOTION_M = 0.5  # shorter motions are too small to judge
OUT_OF_PLANE = 0.3  # vertical extent as a fraction of the horizontal one
MAX_YAW_RAD = 2.0 * np.pi + 0.1  # larger yaw angles are taken for degrees
MAX_TINY_YAW_RAD = np.radians(4.0 * np.pi)  # two turns in radians that were read as degrees
# Variation of the yaw about the course of the path: largest one of yaw that follows it, smallest one of yaw that does not
FOLLOWS, DEVIATES = 0.15, 0.3
COURSE_M = 0.3  # distance over which the course is taken, since positions are noisy
MIN_STRIDES = 50  # smallest number of such distances on a path; on a shorter one they are shorter
MAX_REPEATED = 0.05  # largest fraction of repeated stamps of a series


def series_remarks(series: PoseSeries) -> Iterator[str]:
    """Remarks on one series of poses alone."""
    yield from (f"{series.name}: {note}" for note in series.notes)
    if len(series) > 1 and series.has_stamps and (series.stamps_ns == series.stamps_ns[0]).all():
        yield f"{series.name}: all {len(series)} poses have the same stamp, and only the first one is used"
    elif series.has_stamps and (
        repeated := len(series) - len(np.unique(series.stamps_ns))
    ) > MAX_REPEATED * len(series):
        is_whole = not (series.stamps_ns % NS_PER_S).any()
        cause = " (all stamps are whole seconds: were their fractions lost?)" if is_whole else ""
        yield f"{series.name}: {repeated} of {len(series)} poses repeat a stamp and are not used{cause}"
    yield from _orientation_remarks(series)
    extent = np.ptp(series.positions_m, axis=0) if len(series) else np.zeros(3)
    horizontal = float(np.hypot(extent[0], extent[1]))
    if extent[2] > MIN_MOTION_M and extent[2] > OUT_OF_PLANE * horizontal:
        hint = ""
        if extent[1] < OUT_OF_PLANE * max(extent[0], extent[2]):
            hint = " (a camera frame: x right, y down, z forward?)"
        yield (
            f"{series.name}: the motion leaves the plane: {extent[2]:.1f} m along z, {extent[0]:.1f} m along x, "
            f"{extent[1]:.1f} m along y{hint}; z is ignored"
        )


def _orientation_remarks(series: PoseSeries) -> Iterator[str]:
    if series.quat_wxyz is not None and (order := _level_order(series.quat_wxyz)):
        tilt = _median_tilt(series.quat_wxyz)
        yield (
            f"{series.name}: the orientations are tilted by {tilt:.0f} degrees, but level if the quaternions are "
            f"written {order}: heading errors are wrong"
        )
        return
    if series.yaw is not None and len(series) and np.ptp(series.yaw) > 0 and _looks_like_degrees(series):
        yield f"{series.name}: yaw goes up to {np.abs(series.yaw).max():.0f}: degrees? Radians are expected"
    yaw = series.trajectory.poses[:, 2]
    if series.yaw is not None and _looks_like_radians(series):
        yield f"{series.name}: yaw follows the path only if it is 57.3 times as large: radians in a column of degrees?"
        return
    moves = len(series) > 2 and np.ptp(series.positions_m[:, :2], axis=0).max() > MIN_MOTION_M
    if moves and np.ptp(yaw) < 1e-6 and _changes_direction(series.positions_m[:, :2]):
        yield f"{series.name}: the heading is the same in all poses although the path turns: no orientation was recorded?"


def _looks_like_degrees(series: PoseSeries) -> bool:
    """Yaw beyond a full turn that jumps back (unwrapped radians also exceed a turn, but do not jump)."""
    assert series.yaw is not None
    if np.abs(series.yaw).max() <= MAX_YAW_RAD:
        return False
    as_degrees, as_given = _deviations(series, np.radians(series.yaw), series.yaw)
    return as_degrees <= as_given


def _looks_like_radians(series: PoseSeries) -> bool:
    """Yaw within a few degrees that follows a path with turns as if it were radians that were taken for degrees."""
    assert series.yaw is not None
    if (
        not len(series)
        or np.ptp(series.yaw) > MAX_TINY_YAW_RAD
        or not _changes_direction(series.positions_m[:, :2])
    ):
        return False
    as_radians, as_given = _deviations(series, np.degrees(series.yaw), series.yaw)
    return as_radians < FOLLOWS and as_given > DEVIATES


def _deviations(series: PoseSeries, *yaws: Floats) -> list[float]:
    """Variation, 0 to 1, of each of the yaw angles `(n,)` (rad) about the course of the path; a constant offset counts 0."""
    xy = series.positions_m[:, :2]
    step_m = float(np.median(np.hypot(*np.diff(xy, axis=0).T))) if len(xy) > 1 else 0.0
    stride = int(np.clip(COURSE_M / max(step_m, 1e-9), 1, max(len(xy) // MIN_STRIDES, 1)))
    course = xy[stride:] - xy[:-stride]
    moving = np.hypot(*course.T) > 1e-3
    if np.count_nonzero(moving) < 3:
        return [1.0 for _ in yaws]
    at = np.arctan2(course[moving, 1], course[moving, 0])
    offs = [yaw[:-stride][moving] - at for yaw in yaws]
    return [float(1.0 - np.hypot(np.cos(off).mean(), np.sin(off).mean())) for off in offs]


def _changes_direction(positions: Floats) -> bool:
    """Whether the course of a path changes by more than 45 degrees."""
    steps = np.diff(positions, axis=0)
    steps = steps[np.hypot(steps[:, 0], steps[:, 1]) > 1e-3]
    if len(steps) < 3:
        return False
    course = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    return bool(np.ptp(course) > np.pi / 4)


def _median_tilt(quat_wxyz: Floats) -> float:
    """Median angle (deg) between the z axis of the poses and the vertical."""
    up = 1.0 - 2.0 * (quat_wxyz[:, 1] ** 2 + quat_wxyz[:, 2] ** 2)
    return float(np.degrees(np.median(np.arccos(np.clip(up, -1.0, 1.0)))))


def _level_order(quat_wxyz: Floats) -> str:
    """The order of components that would make tilted orientations level; empty if they are level, or not so either."""
    w, x, y, z = quat_wxyz.T
    if len(quat_wxyz) and _median_tilt(quat_wxyz) > TILTED_DEG:
        if _median_tilt(np.column_stack([x, y, z, w])) < LEVEL_DEG:
            return "w first (qw qx qy qz)"
        if _median_tilt(np.column_stack([z, w, x, y])) < LEVEL_DEG:
            return "w last (qx qy qz qw)"
    return ""
