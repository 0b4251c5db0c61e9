from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.methods.ir_scan.record import trajectory
from gridslam.methods.ir_scan.stops import Place
from gridslam.motion.wheel_gyro import Stretch

PATH = np.array([[0.1 * k, 0.0, 0.0] for k in range(1, 5)])
STRETCH = Stretch(PATH[-1], np.eye(3), np.arange(10, 50, 10), PATH)
SHIFT = np.array([0.04, 0.0, 0.0])
NOTHING = Stretch(np.zeros(3), np.eye(3), np.zeros(0, np.int64), np.zeros((0, 3)))


def places() -> list[Place]:
    start = np.array([1.0, 2.0, np.pi / 2])
    stop = se2.compose(start, PATH[-1])
    return [Place(0, start, np.eye(3), start, None), Place(45, stop, np.eye(3), stop, STRETCH)]


def test_a_correction_is_spread_over_the_way_to_its_stop() -> None:
    both = places()
    poses = np.array([both[0].pose, both[1].pose + SHIFT])
    path = trajectory(both, poses, NOTHING, is_smooth=True)
    assert path.stamps_ns.tolist() == [10, 20, 30, 40, 45]
    assert np.allclose(path.poses[:4, 0], 1.0 + np.array([0.01, 0.02, 0.03, 0.04]))
    assert np.allclose(path.poses[:4, 1], 2.0 + PATH[:, 0])
    assert np.allclose(path.poses[4], poses[1])


def test_on_the_way_the_path_is_what_was_known_then() -> None:
    both = places()
    poses = np.array([both[0].pose, both[1].pose + SHIFT])
    path = trajectory(both, poses, STRETCH, is_smooth=False)
    assert np.allclose(path.poses[:4, 0], 1.0)
    assert np.allclose(path.poses[4], poses[1])


def test_after_the_last_stop_odometry_leads_on() -> None:
    both = places()
    after = Stretch(PATH[-1], np.eye(3), STRETCH.stamps_ns + 100, PATH)
    path = trajectory(both, np.array([p.pose for p in both]), after, is_smooth=True)
    assert np.allclose(path.poses[-1], se2.compose(both[1].pose, PATH[-1]))
    assert path.stamps_ns[-1] == 140


def test_without_odometry_the_path_is_the_stops() -> None:
    both = places()
    both[1].has_odometry = False
    path = trajectory(both, np.array([p.pose for p in both]), NOTHING, is_smooth=True)
    assert path.stamps_ns.tolist() == [45]
