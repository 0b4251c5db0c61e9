"""The record of a run: the path between the stops, the table of stops, the series of the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Series, Table
from gridslam.methods.ir_scan.stops import Stop
from gridslam.motion.wheel_gyro import RelativeMotion

Floats = NDArray[np.float64]

COLUMNS = (
    "stamp_ns", "x", "y", "yaw", "predicted_x", "predicted_y", "predicted_yaw", "readings", "reliable", "verdict", "score",
)  # fmt: skip
M_PER_RAD = 0.1  # rotation counts as much as this distance when a correction is distributed


def trajectory(stops: Sequence[Stop], poses: Floats, last: RelativeMotion, is_smooth: bool) -> Trajectory:
    """The whole path through the `poses` `(s, 3)` of the stops; `last` is the motion since the last stop.

    If `is_smooth`, the correction of each stop is distributed over the path to it; else the path jumps at the stops, as it did
    while driving.
    """
    stamps, path = [], []
    for k, stop in enumerate(stops[1:], start=1):
        if stop.motion is not None and stop.has_odometry:
            stamps.append(stop.motion.stamps_ns)
            path.append(_between_stops(poses[k - 1], poses[k], stop.motion, is_smooth))
        stamps.append(np.array([stop.stamp_ns], np.int64))
        path.append(poses[k][None])
    stamps.append(last.stamps_ns)
    path.append(se2.compose(poses[-1][None], last.path))
    return Trajectory(np.concatenate(stamps), np.concatenate(path)).sorted()


def _between_stops(start: Floats, end: Floats, motion: RelativeMotion, is_smooth: bool) -> Floats:
    """Poses `(n, 3)` of the motion from a stop, deformed so that it ends at the next one if `is_smooth`."""
    path = se2.compose(start[None], motion.path)
    if not is_smooth or not len(path):
        return path
    correction = end - se2.compose(start, motion.T_stop_now)
    correction[2] = float(se2.wrap_angle(correction[2]))
    steps = np.abs(np.diff(motion.path, axis=0, prepend=np.zeros((1, 3))))
    travel = np.cumsum(np.hypot(steps[:, 0], steps[:, 1]) + M_PER_RAD * steps[:, 2])
    fraction = travel / travel[-1] if travel[-1] > 0.0 else np.ones(len(travel))
    path = path + fraction[:, None] * correction
    path[:, 2] = se2.wrap_angle(path[:, 2])
    return path


def stops_table(stops: Sequence[Stop], poses: Floats) -> Table:
    """One row per stop: its pose of `poses` `(s, 3)`, the predicted pose, the numbers of readings, and the match."""
    rows = [
        (
            stop.stamp_ns, *poses[k].tolist(), *stop.predicted.tolist(),
            0 if stop.scan is None else len(stop.scan), 0 if stop.readings is None else len(stop.readings),
            stop.verdict, stop.score,
        )
        for k, stop in enumerate(stops)
        if k > 0
    ]  # fmt: skip
    return Table(COLUMNS, rows)


def series(stops: Sequence[Stop]) -> dict[str, Series]:
    """The correction by each match, and the number of reliable readings."""
    matched = stops[1:]
    if not matched:
        return {}
    stamps = np.array([stop.stamp_ns for stop in matched], np.int64)
    shift = np.array([stop.pose - stop.predicted for stop in matched])
    usable = np.array([0 if stop.readings is None else len(stop.readings) for stop in matched], np.float64)
    return {
        "correction": Series(stamps, np.hypot(shift[:, 0], shift[:, 1]), "m"),
        "heading_correction": Series(stamps, np.degrees(se2.wrap_angle(shift[:, 2])), "deg"),
        "reliable_readings": Series(stamps, usable, "readings"),
    }


def measures(stops: Sequence[Stop]) -> dict[str, object]:
    """Number and results of the matches, for report.json."""
    matched = stops[1:]
    shifts = [float(np.hypot(*(stop.pose - stop.predicted)[:2])) for stop in matched]
    verdicts = Counter(stop.verdict for stop in matched)
    return {
        "stops": len(matched),
        "matches": dict(sorted(verdicts.items())),
        "largest_match_correction_m": max(shifts, default=0.0),
    }
