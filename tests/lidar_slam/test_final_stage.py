"""Loops closed over a whole track, and those that must not be."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.lidar_slam.config import FinalStageConfig
from gridslam.lidar_slam.final_stage import Refined, Refinement, refine
from gridslam.lidar_slam.track import MatchedStepNoise
from tests.lidar_slam.ring import Floats, scan_at
from tests.methods.slam_sd import hall


def refined(truth: Floats, track: Floats, stage: FinalStageConfig | None = None) -> Refined:
    scans = [scan_at(pose, index) for index, pose in enumerate(truth)]
    settings = Refinement(stage or FinalStageConfig(), MatchedStepNoise(), 0.2, 200.0)
    return refine(scans, track, track, settings)


def lap() -> Floats:
    """Key scans once around the ring and two metres on."""
    return hall.path(2)[: len(hall.path(1)) + 14 : 2]


def drifted(truth: Floats, turn_per_step: float) -> Floats:
    """The track of a front end that turns a little too much at every step."""
    poses = [truth[0]]
    for step in se2.between(truth[:-1], truth[1:]):
        poses.append(se2.compose(poses[-1], step + np.array([0.0, 0.0, turn_per_step])))
    return np.array(poses)


def errors(truth: Floats, poses: Floats) -> Floats:
    """Position errors `(n,)`, both starting at the same pose."""
    aligned = se2.compose(truth[0], se2.between(poses[0], poses))
    return np.asarray(np.hypot(*(aligned - truth)[:, :2].T))


def test_a_lap_that_does_not_meet_its_beginning_is_closed() -> None:
    truth = lap()
    track = drifted(truth, 0.0006)
    assert errors(truth, track).max() > 0.5
    found = refined(truth, track)
    assert found.loops_found > 0
    assert errors(truth, found.poses).max() < 0.05


def test_places_that_do_not_see_each_other_are_not_joined() -> None:
    # Out along one corridor and back along the one behind the block: searched for, since they are near, and never found.
    truth = hall.path(1)[: int(0.72 * len(hall.path(1))) : 2]
    found = refined(truth, truth)
    assert found.loops_tried > 0
    assert errors(truth, found.poses).max() < 0.02


def test_a_loop_into_another_place_is_rejected() -> None:
    # The track comes back, by its own account, to where it began, and really is at the far end of the ring.
    truth = hall.path(1)[: int(0.55 * len(hall.path(1))) : 2]
    bent = drifted(truth, np.pi / len(truth))
    found = refined(truth, bent)
    # Nothing ties the two ends, so the track keeps the shape that its steps give it.
    assert found.loops_found == 0 or found.loops_rejected == found.loops_found
    steps = se2.between(bent[:-1], bent[1:])
    np.testing.assert_allclose(
        np.hypot(*se2.between(found.poses[:-1], found.poses[1:])[:, :2].T),
        np.hypot(*steps[:, :2].T),
        atol=0.02,
    )


def test_fewer_than_three_scans_have_nothing_to_close() -> None:
    truth = lap()[:2]
    found = refined(truth, truth)
    np.testing.assert_array_equal(found.poses, truth)
    assert found.matches == found.loops_tried == 0
