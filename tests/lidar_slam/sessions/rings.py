"""Drives through a ring of corridors that looks different from each side, as sessions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pytest import MonkeyPatch

from gridslam.core import poses as se2
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.loop_closure.trajectory import close_trajectory
from gridslam.lidar_slam.sessions.continuation import Continued, continue_session
from gridslam.lidar_slam.sessions.session import Constraints, Drive, Session
from tests.lidar_slam.ring import scan_at
from tests.methods.slam_sd import hall

Floats = NDArray[np.float64]

BOTTOM = [(-1, -1), (4, -1), (4, -2.5), (6.5, -2.5), (6.5, -1), (13, -1), (13, 2), (14, 2), (14, 5), (13, 5)]
TOP = [(13, 8), (10, 8), (10, 11), (8, 11), (8, 8), (-1, 8), (-1, 6), (-3, 4.5), (-1, 3)]
CORNERS = np.array([*BOTTOM, *TOP], np.float64)
PLACE = np.concatenate([np.hstack([CORNERS, np.roll(CORNERS, -1, axis=0)]), hall.WALLS[4:]])
LAP = hall.path(2)[: len(hall.path(1)) + 14 : 2]


def drive_along(truth: Floats, log: str, first_index: int = 0, walls: Floats = PLACE) -> Drive:
    """A drive along true poses `(n, 3)` between walls `(m, 4)`, whose front end starts at the origin and drifts."""
    track = [np.zeros(3)]
    for step in se2.between(truth[:-1], truth[1:]):
        track.append(se2.compose(track[-1], step + np.array([0.0, 0.0, 0.0003])))
    with MonkeyPatch.context() as patch:
        patch.setattr(hall, "WALLS", walls)
        scans = [scan_at(pose, first_index + k) for k, pose in enumerate(truth)]
    stamps = np.array([scan.stamp_ns for scan in scans], np.int64)
    return Drive(log, stamps, np.array(track), np.arange(len(scans)), scans)


def mapped(drive: Drive) -> tuple[Floats, Constraints]:
    """Poses and constraints of a drive that is mapped on its own."""
    closed = close_trajectory(drive.scans, drive.key_track)
    empty = Constraints.none()
    return closed.poses, Constraints(closed.loops, closed.visits, empty.landmarks)


def session_of(drive: Drive) -> Session:
    """The session of one drive."""
    poses, constraints = mapped(drive)
    return Session((drive,), poses, np.zeros(1, np.int64), constraints)


def continued(session: Session, drive: Drive) -> Continued:
    """The session with one more drive."""
    return continue_session(session, drive, *mapped(drive), DriftModel())


def errors(session: Session, truths: list[Floats]) -> Floats:
    """Position errors `(k,)` (m) of all key scans, given the true poses of each drive, aligned at the first."""
    truth = np.concatenate(truths)
    aligned = se2.compose(se2.compose(truth[0], se2.inverse(session.poses[0])), session.poses)
    return np.asarray(np.hypot(*(aligned - truth)[:, :2].T))
