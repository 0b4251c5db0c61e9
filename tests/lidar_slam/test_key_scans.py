"""Key scans: when one is due, and corrections distributed over all scans."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.key_scans import KeyScanSpacing, distribute_corrections


def test_key_scans_get_their_poses_and_other_scans_follow() -> None:
    rng = np.random.default_rng(2)
    track = np.cumsum(rng.normal([0.1, 0.0, 0.0], 0.02, (31, 3)), axis=0)
    keys = np.array([0, 8, 9, 22])
    key_poses = se2.compose(np.array([1.0, 2.0, 0.5]), track[keys]) + rng.normal(0.0, 0.05, (4, 3))
    poses = distribute_corrections(track, keys, key_poses)
    np.testing.assert_allclose(poses[keys], key_poses, atol=1e-12)
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    before = np.hypot(*np.diff(track[:, :2], axis=0).T)
    assert np.abs(steps - before).max() < 0.15


def test_key_scans_moved_as_a_whole_move_all_scans_alike() -> None:
    track = np.cumsum(np.random.default_rng(3).normal(0.0, 0.1, (12, 3)), axis=0)
    T_map_track = np.array([3.0, -1.0, 2.0])
    keys = np.array([0, 5, 11])
    poses = distribute_corrections(track, keys, se2.compose(T_map_track, track[keys]))
    expected = se2.compose(T_map_track, track)
    np.testing.assert_allclose(se2.between(expected, poses), 0.0, atol=1e-9)


def test_a_key_scan_is_due_after_a_distance_or_a_rotation() -> None:
    spacing = KeyScanSpacing(distance_m=0.25, rotation_rad=0.25)
    here = np.array([1.0, 2.0, 3.1])
    assert not spacing.is_due(here, here)
    assert spacing.is_due(here, se2.compose(here, np.array([0.2, 0.2, 0.0])))
    assert spacing.is_due(here, se2.compose(here, np.array([0.0, 0.0, -0.3])))
