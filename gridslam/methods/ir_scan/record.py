"""What a run puts on record: the path between the stops, the table of stops, the series of the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.methods.base import Series, Table
from gridslam.methods.ir_scan.stops import Place
from gridslam.motion.wheel_gyro import Stretch

Floats = NDArray[np.float64]

COLUMNS = (
    "stamp_ns", "x", "y", "yaw", "predicted_x", "predicted_y", "predicted_yaw", "readings", "reliable", "verdict", "score",
)  # fmt: skip


def trajectory(places: Sequence[Place], poses: Floats, after: Stretch, is_smooth: bool) -> Trajectory:
    """The whole path under poses of the places `(p, 3)`; `after` is the motion since the last one.

    As it was known on the way, or, where `is_smooth`, with each stop's correction spread over the way to it.
    """
    stamps, path = [], []
    for k, place in enumerate(places[1:], start=1):
        if place.stretch is not None and place.has_odometry:
            stamps.append(place.stretch.stamps_ns)
            path.append(_between_stops(poses[k - 1], poses[k], place.stretch, is_smooth))
        stamps.append(np.array([place.stamp_ns], np.int64))
        path.append(poses[k][None])
    stamps.append(after.stamps_ns)
    path.append(se2.compose(poses[-1][None], after.path))
    return Trajectory(np.concatenate(stamps), np.concatenate(path)).sorted()


def _between_stops(start: Floats, end: Floats, stretch: Stretch, is_smooth: bool) -> Floats:
    """Poses `(n, 3)` of a stretch of way from a stop, bent to end at the next one."""
    path = se2.compose(start[None], stretch.path)
    if not is_smooth or not len(path):
        return path
    off = end - se2.compose(start, stretch.T_stop_now)
    off[2] = float(se2.wrap_angle(off[2]))
    steps = np.abs(np.diff(stretch.path, axis=0, prepend=np.zeros((1, 3))))
    way = np.cumsum(np.hypot(steps[:, 0], steps[:, 1]) + 0.1 * steps[:, 2])
    path = path + (way / way[-1] if way[-1] > 0.0 else np.ones(len(way)))[:, None] * off
    path[:, 2] = se2.wrap_angle(path[:, 2])
    return path


def stops_table(places: Sequence[Place], poses: Floats) -> Table:
    """A row a stop: where it was, where odometry had it, what its scan gave, and what matching said."""
    rows = [
        (
            place.stamp_ns, *poses[k].tolist(), *place.predicted.tolist(),
            0 if place.scan is None else len(place.scan), 0 if place.ends is None else len(place.ends),
            place.verdict, place.score,
        )
        for k, place in enumerate(places)
        if k > 0
    ]  # fmt: skip
    return Table(COLUMNS, rows)


def series(places: Sequence[Place]) -> dict[str, Series]:
    """What each match corrected, and how many readings it could use."""
    stops = places[1:]
    if not stops:
        return {}
    stamps = np.array([place.stamp_ns for place in stops], np.int64)
    shift = np.array([place.pose - place.predicted for place in stops])
    usable = np.array([0 if place.ends is None else len(place.ends) for place in stops], np.float64)
    return {
        "correction": Series(stamps, np.hypot(shift[:, 0], shift[:, 1]), "m"),
        "heading_correction": Series(stamps, np.degrees(se2.wrap_angle(shift[:, 2])), "deg"),
        "reliable_readings": Series(stamps, usable, "readings"),
    }


def measures(places: Sequence[Place]) -> dict[str, object]:
    """How the matches went, for report.json."""
    stops = places[1:]
    shifts = [float(np.hypot(*(p.pose - p.predicted)[:2])) for p in stops]
    verdicts = Counter(place.verdict for place in stops)
    return {
        "stops": len(stops),
        "matches": dict(sorted(verdicts.items())),
        "largest_match_correction_m": max(shifts, default=0.0),
    }
