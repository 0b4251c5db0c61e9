from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.methods.ir_scan.record import trajectory
from gridslam.methods.ir_scan.stops import Stop
from gridslam.motion.wheel_gyro import RelativeMotion

PATH = np.array([[0.1 * k, 0.0, 0.0] for k in range(1, 5)])
MOTION = RelativeMotion(PATH[-1], np.eye(3), np.arange(10, 50, 10), PATH)
SHIFT = np.array([0.04, 0.0, 0.0])
STANDING = RelativeMotion(np.zeros(3), np.eye(3), np.zeros(0, np.int64), np.zeros((0, 3)))


def start_and_stop() -> list[Stop]:
    start = np.array([1.0, 2.0, np.pi / 2])
    stop = se2.compose(start, PATH[-1])
    return [Stop(0, start, np.eye(3), start, None), Stop(45, stop, np.eye(3), stop, MOTION)]


def test_a_correction_is_distributed_over_the_path_to_its_stop() -> None:
    stops = start_and_stop()
    poses = np.array([stops[0].pose, stops[1].pose + SHIFT])
    path = trajectory(stops, poses, STANDING, is_smooth=True)
    assert path.stamps_ns.tolist() == [10, 20, 30, 40, 45]
    assert np.allclose(path.poses[:4, 0], 1.0 + np.array([0.01, 0.02, 0.03, 0.04]))
    assert np.allclose(path.poses[:4, 1], 2.0 + PATH[:, 0])
    assert np.allclose(path.poses[4], poses[1])


def test_without_smoothing_the_path_is_that_known_while_driving() -> None:
    stops = start_and_stop()
    poses = np.array([stops[0].pose, stops[1].pose + SHIFT])
    path = trajectory(stops, poses, MOTION, is_smooth=False)
    assert np.allclose(path.poses[:4, 0], 1.0)
    assert np.allclose(path.poses[4], poses[1])


def test_after_the_last_stop_the_path_follows_odometry() -> None:
    stops = start_and_stop()
    after = RelativeMotion(PATH[-1], np.eye(3), MOTION.stamps_ns + 100, PATH)
    path = trajectory(stops, np.array([p.pose for p in stops]), after, is_smooth=True)
    assert np.allclose(path.poses[-1], se2.compose(stops[1].pose, PATH[-1]))
    assert path.stamps_ns[-1] == 140


def test_without_odometry_the_path_consists_of_the_stops() -> None:
    stops = start_and_stop()
    stops[1].has_odometry = False
    path = trajectory(stops, np.array([p.pose for p in stops]), STANDING, is_smooth=True)
    assert path.stamps_ns.tolist() == [45]
