"""Corrections of key scans spread over all scans."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.track import is_far, spread_corrections


def test_key_scans_get_their_poses_and_the_others_move_in_between() -> None:
    rng = np.random.default_rng(2)
    track = np.cumsum(rng.normal([0.1, 0.0, 0.0], 0.02, (31, 3)), axis=0)
    keys = np.array([0, 8, 9, 22])
    key_poses = se2.compose(np.array([1.0, 2.0, 0.5]), track[keys]) + rng.normal(0.0, 0.05, (4, 3))
    poses = spread_corrections(track, keys, key_poses)
    np.testing.assert_allclose(poses[keys], key_poses, atol=1e-12)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    before = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert np.abs(steps - before).max() < 0.15


def test_a_track_that_needs_no_correction_is_only_moved_as_a_whole() -> None:
    track = np.cumsum(np.random.default_rng(3).normal(0.0, 0.1, (12, 3)), axis=0)
    T_map_track = np.array([3.0, -1.0, 2.0])
    keys = np.array([0, 5, 11])
    poses = spread_corrections(track, keys, se2.compose(T_map_track, track[keys]))
    expected = se2.compose(T_map_track, track)
    np.testing.assert_allclose(se2.between(expected, poses), 0.0, atol=1e-9)


def test_far_is_a_distance_or_a_turn() -> None:
    here = np.array([1.0, 2.0, 3.1])
    assert not is_far(here, here, 0.25, 0.25)
    assert is_far(here, se2.compose(here, np.array([0.2, 0.2, 0.0])), 0.25, 0.25)
    assert is_far(here, se2.compose(here, np.array([0.0, 0.0, -0.3])), 0.25, 0.25)
