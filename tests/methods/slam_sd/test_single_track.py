"""The front end's track in the filter's place: its path, and that asking for it at each key scan copies nothing."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.methods.slam_sd.single_track import FIRST_KEY_SCANS, SingleTrack

NOTHING = np.zeros((0, 2))
SCAN = PreparedScan(0, np.zeros(2), NOTHING, NOTHING, NOTHING, NOTHING, NOTHING)
STEP = np.array([0.3, 0.05, 0.1])


def test_the_path_is_that_of_the_steps_beyond_the_room_at_first() -> None:
    track = SingleTrack()
    assert track.best_trajectory.shape == (0, 3)
    assert track.poses.tolist() == [[0.0, 0.0, 0.0]]
    expected = [np.zeros(3)]
    for _ in range(3 * FIRST_KEY_SCANS):
        track.add_key_scan(SCAN, STEP, STEP)
        expected.append(se2.compose(expected[-1], STEP))
    assert track.best_trajectory == pytest.approx(np.array(expected[:-1]))
    assert track.trajectories.shape == (1, 3 * FIRST_KEY_SCANS, 3)
    assert np.array_equal(track.poses[0], track.best_trajectory[-1])


def test_the_path_so_far_is_not_copied_and_keeps_its_values() -> None:
    track = SingleTrack()
    for _ in range(FIRST_KEY_SCANS):
        track.add_key_scan(SCAN, STEP, STEP)
    early = track.best_trajectory
    assert track.best_trajectory.base is early.base
    kept = early.copy()
    track.add_key_scan(SCAN, STEP, STEP)
    assert np.array_equal(early, kept)
    assert np.array_equal(track.best_trajectory[:-1], kept)
