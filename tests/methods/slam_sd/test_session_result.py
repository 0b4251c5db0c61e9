"""What a run says of a session that its drive does not fit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.lidar_slam.sessions.session import Constraints, Session
from gridslam.lidar_slam.sessions.session_file import read_session
from gridslam.methods.base import RunResult
from gridslam.methods.slam_sd.config import SlamSdConfig
from gridslam.methods.slam_sd.method import SlamSd
from gridslam.methods.slam_sd.session_result import apart_reason, range_m_of, range_notes
from tests.lidar_slam.sessions.rings import LAP, drive_along, session_of
from tests.lidar_slam.test_sway import swaying_drive


@pytest.fixture(scope="module")
def first() -> Session:
    return session_of(drive_along(LAP[:12], "monday.mcap"))


def with_second(first: Session, scale: float) -> Session:
    """The session and a drive whose lidar sees `scale` times as far."""
    (drive,) = first.drives
    scans = [
        replace(scan, returns=scan.viewpoint + scale * (scan.returns - scan.viewpoint))
        for scan in drive.scans
    ]
    drive = replace(drive, range_m=range_m_of(drive.scans))
    second = replace(drive, log="thursday.mcap", scans=scans, range_m=range_m_of(scans))
    return Session((drive, second), np.tile(first.poses, (2, 1)), np.zeros(2, np.int64), Constraints.none())


def test_two_lidars_of_different_range_are_noted_in_both_orders(first: Session) -> None:
    assert range_notes(with_second(first, 1.2)) == []
    for scale in (0.5, 2.0):
        (note,) = range_notes(with_second(first, scale))
        assert "drive 1 (monday.mcap)" in note and "not compared" in note


def test_a_drive_that_does_not_overlap_is_named_and_said_to_be_kept(first: Session) -> None:
    reason = apart_reason(with_second(first, 1.0))
    assert reason.startswith("thursday.mcap was not found to overlap") and "both are kept" in reason


def mapped(log: str, session: Session | None) -> RunResult:
    """A swaying drive, which may continue a session."""
    method = SlamSd(SlamSdConfig(), 0, session=session, log_name=log)
    for event in swaying_drive(0.5)[0]:
        method.process(replace(event, stamp_ns=event.stamp_ns + (10**11 if session else 0)))
    return method.result()


def test_paths_of_a_continued_map_are_those_of_robots_that_sway_and_not_of_their_lidars() -> None:
    first = mapped("monday.mcap", None)
    session = read_session(first.files["session.npz"], "session.npz")
    second = mapped("thursday.mcap", session)
    assert session.drives[0].swing_m is not None
    for name in ("trajectory_1", "trajectory_2"):
        poses = second.trajectories[name].poses
        moved = se2.compose(se2.compose(first.trajectory.poses[0], se2.inverse(poses[0])), poses)
        assert np.hypot(*(moved - first.trajectory.poses)[:, :2].T).max() < 0.005
