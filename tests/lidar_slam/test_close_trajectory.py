"""Loop closure over a whole track, and loops that must not be closed."""

from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.loop_closure.segments import Segments, cut_segments, deform_track
from gridslam.lidar_slam.loop_closure.trajectory import (
    ClosedTrajectory,
    close_trajectory,
    unspanned_stretches,
)
from tests.lidar_slam.ring import Floats, scan_at
from tests.methods.slam_sd import hall


def closed(truth: Floats, track: Floats) -> ClosedTrajectory:
    return close_trajectory([scan_at(pose, index) for index, pose in enumerate(truth)], track)


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
    found = closed(truth, track)
    assert len(found.loops) > 0
    assert errors(truth, found.poses).max() < 0.06
    np.testing.assert_allclose(found.poses[0], track[0], atol=1e-9)


def test_places_on_both_sides_of_a_wall_are_not_matched() -> None:
    # Out along one corridor and back along the one behind the block: near each other, and never matched.
    truth = hall.path(1)[: int(0.72 * len(hall.path(1))) : 2]
    found = closed(truth, truth)
    assert errors(truth, found.poses).max() < 0.02


def test_a_loop_into_another_place_is_not_accepted() -> None:
    # By its drifted track the robot has returned to the start; in truth it is at the far end of the ring.
    truth = hall.path(1)[: int(0.55 * len(hall.path(1))) : 2]
    track = drifted(truth, np.pi / len(truth))
    found = closed(truth, track)
    assert len(found.loops) == 0
    steps = se2.between(track[:-1], track[1:])
    np.testing.assert_allclose(
        np.hypot(*se2.between(found.poses[:-1], found.poses[1:])[:, :2].T),
        np.hypot(*steps[:, :2].T),
        atol=0.02,
    )
    np.testing.assert_array_equal(found.unspanned, [[0, len(track) - 1]])


def test_a_single_key_scan_remains_where_it_is() -> None:
    found = closed(lap()[:1], lap()[:1])
    np.testing.assert_allclose(found.poses, lap()[:1])
    assert set(found.measures.values()) == {0}


def test_segments_hold_all_key_scans_and_about_their_length_of_travel() -> None:
    track = hall.path(1)
    segments = cut_segments(track, 3.0)
    assert segments.first[0] == 0
    assert segments.first[-1] == len(track)
    assert (segments.reference >= segments.first[:-1]).all()
    assert (segments.reference < segments.first[1:]).all()
    assert np.diff(segments.travel_m).max() < 3.5


def test_a_track_is_moved_with_its_segments() -> None:
    track = hall.path(1)
    segments = cut_segments(track, 3.0)
    motion = np.array([1.0, -2.0, 0.5])
    moved = deform_track(track, segments, se2.compose(motion, track[segments.reference]))
    np.testing.assert_allclose(se2.between(se2.compose(motion, track), moved), 0.0, atol=1e-9)


def test_stretches_that_no_loop_spans_are_found() -> None:
    segments = Segments(np.arange(0, 22, 2), np.arange(0, 20, 2), np.arange(10.0))
    loops = Edges(np.array([2]), np.array([5]), np.zeros((1, 3)), np.eye(3)[None], np.ones(1, np.bool_))
    np.testing.assert_array_equal(unspanned_stretches(loops, segments, 20), [[0, 4], [10, 19]])
    np.testing.assert_array_equal(unspanned_stretches(Edges.none(), segments, 20), [[0, 19]])
