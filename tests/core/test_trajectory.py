from __future__ import annotations

import numpy as np
import pytest

from gridslam.core.trajectory import Trajectory, pose_at

STAMPS = [100, 200, 400]
POSES = [np.array(p) for p in ([0.0, 0.0, 3.0], [1.0, 2.0, -3.0], [5.0, 2.0, -3.0])]


@pytest.mark.parametrize(
    ("stamp_ns", "expected"),
    [
        (100, POSES[0]),
        (200, POSES[1]),
        (400, POSES[2]),
        (250, [2.0, 2.0, -3.0]),
        (150, [0.5, 1.0, np.pi]),  # yaw turns the short way, through pi
    ],
)
def test_a_pose_at_a_stamp_lies_between_its_neighbours(stamp_ns: int, expected: list[float]) -> None:
    pose = pose_at(stamp_ns, STAMPS, POSES)
    assert pose is not None
    np.testing.assert_allclose(pose, expected, atol=1e-12)


@pytest.mark.parametrize("stamp_ns", [99, 401])
def test_outside_of_the_stamps_there_is_no_pose(stamp_ns: int) -> None:
    assert pose_at(stamp_ns, STAMPS, POSES) is None


def test_without_poses_there_is_none() -> None:
    assert pose_at(1, [], []) is None


def test_there_is_no_pose_in_a_gap() -> None:
    stamps_ns, poses = [0, 10, 30], [np.zeros(3), np.zeros(3), np.zeros(3)]
    assert pose_at(5, stamps_ns, poses, max_gap_ns=20) is not None
    assert pose_at(20, stamps_ns, poses, max_gap_ns=20) is None


def test_poses_at_many_stamps_equal_those_at_each_and_end_with_the_trajectory() -> None:
    trajectory = Trajectory(np.array(STAMPS), np.array(POSES))
    poses, inside = trajectory.at(np.array([50, 100, 150, 250, 400, 500]))
    assert inside.tolist() == [False, True, True, True, True, False]
    for stamp_ns, pose in zip((100, 150, 250, 400), poses[1:5], strict=True):
        np.testing.assert_allclose(pose, pose_at(stamp_ns, STAMPS, POSES), atol=1e-12)
    np.testing.assert_array_equal(poses[[0, -1]], [POSES[0], POSES[-1]])
    nothing, found = Trajectory.empty().at(np.array([1]))
    assert nothing.shape == (1, 3) and not found.any()
