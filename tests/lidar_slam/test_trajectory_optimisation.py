"""Loop closure over a whole track, and loops that must not be closed."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.config import LoopClosureConfig
from gridslam.lidar_slam.key_scans import StepNoise
from gridslam.lidar_slam.trajectory_optimisation import (
    OptimisedTrajectory,
    TrajectoryOptimiser,
    optimise_trajectory,
)
from tests.lidar_slam.ring import Floats, scan_at
from tests.methods.slam_sd import hall


def optimised(truth: Floats, track: Floats) -> OptimisedTrajectory:
    scans = [scan_at(pose, index) for index, pose in enumerate(truth)]
    settings = TrajectoryOptimiser(LoopClosureConfig(), StepNoise(), memory_limit_mb=200.0)
    return optimise_trajectory(scans, track, track, settings)


def lap() -> Floats:
    """Key scans once around the ring and two metres on."""
    return hall.path(2)[: len(hall.path(1)) + 14 : 2]


def drifted(truth: Floats, yaw_error_per_step: float) -> Floats:
    """The track of a front end with the same heading error at every step."""
    poses = [truth[0]]
    for step in se2.between(truth[:-1], truth[1:]):
        poses.append(se2.compose(poses[-1], step + np.array([0.0, 0.0, yaw_error_per_step])))
    return np.array(poses)


def errors(truth: Floats, poses: Floats) -> Floats:
    """Position errors `(n,)`, both starting at the same pose."""
    aligned = se2.compose(truth[0], se2.between(poses[0], poses))
    return np.asarray(np.hypot(*(aligned - truth)[:, :2].T))


def test_a_drifted_lap_is_closed() -> None:
    truth = lap()
    track = drifted(truth, 0.0006)
    assert errors(truth, track).max() > 0.5
    found = optimised(truth, track)
    assert found.loops_found > 0
    assert errors(truth, found.poses).max() < 0.05


def test_places_on_both_sides_of_a_wall_are_not_matched() -> None:
    # Out along one corridor and back along the one behind the block: near each other, so searched, and never matched.
    truth = hall.path(1)[: int(0.72 * len(hall.path(1))) : 2]
    found = optimised(truth, truth)
    assert found.pairs_searched > 0
    assert errors(truth, found.poses).max() < 0.02


def test_a_loop_into_another_place_is_rejected() -> None:
    # By its drifted track the robot has returned to the start; in truth it is at the far end of the ring.
    truth = hall.path(1)[: int(0.55 * len(hall.path(1))) : 2]
    track = drifted(truth, np.pi / len(truth))
    found = optimised(truth, track)
    # Without a loop the track keeps the shape that its steps give it.
    assert found.loops_found == 0 or found.loops_rejected == found.loops_found
    steps = se2.between(track[:-1], track[1:])
    np.testing.assert_allclose(
        np.hypot(*se2.between(found.poses[:-1], found.poses[1:])[:, :2].T),
        np.hypot(*steps[:, :2].T),
        atol=0.02,
    )


def test_fewer_than_three_scans_are_returned_unchanged() -> None:
    truth = lap()[:2]
    found = optimised(truth, truth)
    np.testing.assert_array_equal(found.poses, truth)
    assert found.matches == found.pairs_searched == 0
