"""Key scans of earlier drives that few later drives repeat: new drives are matched and compared with these alone.

A robot that drives along the same corridor every day is so compared with the last few days only, at the same cost every day.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.lidar_slam.scans import PreparedScan
from gridslam.lidar_slam.sessions.session import Session
from gridslam.lidar_slam.sessions.stored_scans import StoredScans, empty_scan

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

# Number of later drives in the place of a key scan from which it adds little to what they saw
LATER_DRIVES = 2
NEAR_M = 1.5  # distance within which poses are at the same place
# ... with this difference of the headings at most: many lidars see only what is before the robot
NEAR_RAD = np.pi / 3


def active_keys(session: Session) -> list[Bools]:
    """For each drive, which of its key scans `(k,)` were made where fewer than `LATER_DRIVES` later drives of its part were."""
    found: list[Bools] = [np.zeros(0, np.bool_)] * len(session.drives)
    for part in np.unique(session.parts):
        places, owners = np.zeros((0, 4)), np.zeros(0, np.int64)
        for d in np.flatnonzero(session.parts == part)[::-1].tolist():
            own = _places(session.poses_of(d))
            found[d] = _later_drives(own, places, owners) < LATER_DRIVES
            places = np.concatenate([places, own[found[d]]])
            owners = np.concatenate([owners, np.full(int(found[d].sum()), d)])
    return found


def active_scans(session: Session) -> list[PreparedScan]:
    """All key scans, those that are not active as if they had seen nothing."""
    scans: list[PreparedScan] = []
    for drive, is_active in zip(session.drives, active_keys(session), strict=True):
        scans += [
            drive.scans[k] if active else _without_points(drive.scans, k)
            for k, active in enumerate(is_active.tolist())
        ]
    return scans


def _without_points(scans: Sequence[PreparedScan], index: int) -> PreparedScan:
    if isinstance(scans, StoredScans):
        return scans.without_points(index)
    return empty_scan(scans[index].stamp_ns, scans[index].viewpoint)


def _places(poses: Floats) -> Floats:
    """Points `(k, 4)` that are `NEAR_M` apart where poses are as far apart, or turned by `NEAR_RAD`."""
    radius = NEAR_M / (2.0 * np.sin(0.5 * NEAR_RAD))
    return np.column_stack([poses[:, :2], radius * np.cos(poses[:, 2]), radius * np.sin(poses[:, 2])])


def _later_drives(own: Floats, places: Floats, owners: NDArray[np.int64]) -> NDArray[np.int64]:
    """Number `(k,)` of different drives with a place near each of one's own `(k, 4)`; `owners` are the drives of `places`."""
    if not len(places):
        return np.zeros(len(own), np.int64)
    near = cKDTree(places).query_ball_point(own, NEAR_M)
    return np.array([len(np.unique(owners[rows])) for rows in near], np.int64)
