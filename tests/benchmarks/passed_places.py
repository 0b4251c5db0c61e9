"""Recorded logs in which places are passed again: the map is made of the first passes, and the drives are later ones.

The poses are those of slam-sd over all passes, which stand for the truth. No scan of a drive is in the map.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sessions.session_file import read_session
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import SlamSd
from gridslam.sensors.lidar_beams import extrinsics_of
from tests.benchmarks.real_places import RealPlace, events_of, map_of

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

NAMES = ("wean-hall", "aces", "mit-csail", "mit-killian")
AGAIN_M, AFTER_M = 3.0, 20.0  # a pose this near to one of so much travel ago belongs to a later pass
MAP_STEP_M, MAP_STEP_RAD = 0.2, 0.2  # between the scans that make the map
MIN_AGAIN = 0.8  # fraction of a drive's poses that belong to a later pass


@cache
def passed_place(folder: Path, name: str) -> tuple[RealPlace, Bools]:
    """Wean Hall, aces, mit-csail or mit-killian, and which of its poses `(n,)` belong to later passes."""
    if name == "wean-hall":
        logs = [folder / "wean_hall" / f"robotdata{k}.log.gz" for k in (2, 1)]
        paths = _mapped(logs)
        drive = RealPlace(events_of(logs[1]), _map(events_of(logs[0]), paths[0]), *_columns(paths[1]))
        near = cKDTree(paths[0].poses[:, :2]).query(paths[1].poses[:, :2])[0]
        return drive, np.asarray(near < AGAIN_M)
    log = folder / "lidar" / f"{name}.clf.bz2"
    (path,), events = _mapped([log]), events_of(log)
    is_again = _is_again(path.poses)
    first = Trajectory(path.stamps_ns[~is_again], path.poses[~is_again])
    return RealPlace(events, _map(events, first), *_columns(path)), is_again


def starts(here: RealPlace, is_again: Bools, travel_m: float, count: int) -> list[int]:
    """First rows of `count` drives of this travel on later passes, evenly from all that there are."""
    travel = travel_of(here.poses)
    rows = np.flatnonzero(is_again)
    ends = np.searchsorted(travel, travel[rows] + travel_m)
    passed = np.r_[0, np.cumsum(is_again)]
    possible = [
        int(first)
        for first, last in zip(rows, ends, strict=True)
        if last < len(travel)
        and is_again[last]
        and passed[last] - passed[first] >= MIN_AGAIN * (last - first)
    ]
    return [possible[k] for k in np.linspace(0, len(possible) - 1, count).astype(int)]


def travel_of(poses: Floats) -> Floats:
    """Travel `(n,)` up to each of the poses `(n, 3)`, m."""
    return np.r_[0.0, np.cumsum(np.hypot(*np.diff(poses[:, :2], axis=0).T))]


def _mapped(logs: list[Path]) -> list[Trajectory]:
    """The paths of logs in one frame, by slam-sd."""
    session, result = None, None
    for log in logs:
        method = SlamSd(SlamSdConfig(), 0, session=session, log_name=log.name)
        for event in events_of(log):
            method.process(event)
        result = method.result()
        if len(logs) > 1:
            session = read_session(result.files["session.npz"], "session.npz")
    assert result is not None
    if len(logs) == 1:
        return [result.trajectory]
    return [result.trajectories[f"trajectory_{k + 1}"] for k in range(len(logs))]


def _map(events: list[Event], path: Trajectory) -> OccupancyGrid:
    """The map of the scans with a pose, some decimetres apart."""
    sensor = next(
        (extrinsics_of(e).pose for e in events if isinstance(e, Transform) and e.is_static), np.zeros(3)
    )
    scans = {event.stamp_ns: event for event in events if isinstance(event, LaserScan)}
    kept: list[int] = []
    for row, stamp_ns in enumerate(path.stamps_ns.tolist()):
        step = se2.between(path.poses[kept[-1]], path.poses[row]) if kept else np.full(3, np.inf)
        is_far = np.hypot(step[0], step[1]) > MAP_STEP_M or abs(step[2]) > MAP_STEP_RAD
        if stamp_ns in scans and is_far:
            kept.append(row)
    chosen = [scans[int(path.stamps_ns[row])] for row in kept]
    return map_of(chosen, se2.compose(path.poses[kept], sensor))


def _is_again(poses: Floats) -> Bools:
    """Which of the poses `(n, 3)` are near to an earlier one, with travel in between."""
    travel = travel_of(poses)
    near = cKDTree(poses[:, :2]).query_ball_point(poses[:, :2], AGAIN_M)
    return np.array([travel[i] - travel[min(rows)] > AFTER_M for i, rows in enumerate(near)])


def _columns(path: Trajectory) -> tuple[NDArray[np.int64], Floats]:
    return path.stamps_ns, path.poses
