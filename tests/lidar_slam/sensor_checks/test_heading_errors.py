"""Odometry that turns too much or too little, or drifts, is found, named and corrected; small errors are left to the matching."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gridslam.core import poses as se2
from gridslam.core.messages import Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks.corrected_events import OdometryCorrector
from gridslam.lidar_slam.sensor_checks.heading_errors import NO_ERRORS, HeadingErrors
from gridslam.lidar_slam.sensor_checks.motion_windows import windows_of
from gridslam.lidar_slam.sensor_checks.odometry_calibration import calibrate

NS = 10**9


def winding(seconds: float = 60.0, rate_hz: float = 20.0) -> Trajectory:
    """A path of 0.5 m/s whose yaw rate changes all the time, with a stand every ten seconds."""
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    yaw = np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)
    step = np.where(t % 10.0 < 8.0, 0.5, 0.05) / rate_hz
    x, y = np.cumsum(step * np.cos(yaw)), np.cumsum(step * np.sin(yaw))
    return Trajectory((t * NS).astype(np.int64), np.column_stack([x, y, yaw]))


def deformed(path: Trajectory, rotation: Callable[[np.ndarray, float], float]) -> Trajectory:
    """What odometry makes of the path whose steps `(3,)` over a time (s) rotation otherwise."""
    poses = [path.poses[0]]
    for k in range(1, len(path)):
        step = se2.between(path.poses[k - 1], path.poses[k])
        elapsed_s = float(path.stamps_ns[k] - path.stamps_ns[k - 1]) / NS
        poses.append(se2.compose(poses[-1], [step[0], step[1], rotation(step, elapsed_s)]))
    return Trajectory(path.stamps_ns, np.array(poses))


FAULTS: dict[str, tuple[Callable[[np.ndarray, float], float], str]] = {
    "less": (lambda step, s: 0.9 * step[2], "its rotations are 0.90 of the true ones"),
    "more": (lambda step, s: 1.25 * step[2], "its rotations are 1.25 of the true ones"),
    "wheels": (lambda step, s: step[2] - 0.1 * step[0], "heading drifts by 5.7 deg per metre to the right"),
    "gyro": (lambda step, s: step[2] + 0.05 * s, "its heading drifts by 2.9 deg per second to the left"),
}


@pytest.mark.parametrize(("rotation", "says"), FAULTS.values(), ids=FAULTS)
def test_errors_of_turns_are_named_and_undone(
    rotation: Callable[[np.ndarray, float], float], says: str
) -> None:
    truth = winding()
    wrong = deformed(truth, rotation)
    found = calibrate(windows_of(truth, wrong))
    assert len(found.faults) == 1
    assert says in found.faults[0]
    corrector = OdometryCorrector(found)
    rows = zip(wrong.stamps_ns.tolist(), wrong.poses.tolist(), strict=True)
    given = np.array([corrector.corrected(Odometry(stamp, "odom", *pose)).pose for stamp, pose in rows])
    assert np.abs(se2.between(truth.poses, given))[:, :2].max() < 0.2
    np.testing.assert_allclose(
        found.heading.removed_from(wrong.stamps_ns / NS, wrong.poses)[:, :2], given[:, :2], atol=1e-6
    )


@pytest.mark.parametrize("scale", [0.95, 1.0, 1.05])
@pytest.mark.parametrize("seed", range(3))
def test_small_and_random_errors_are_no_fault(scale: float, seed: int) -> None:
    rng, truth = np.random.default_rng(seed), winding()
    noisy = deformed(truth, lambda step, s: scale * step[2] + 0.01 * step[0] + rng.normal(0.0, 0.01))
    assert calibrate(windows_of(truth, noisy)).heading == NO_ERRORS


def test_odometry_that_does_not_turn_shows_no_errors() -> None:
    truth = winding()
    straight = deformed(truth, lambda step, s: 0.0)
    assert calibrate(windows_of(truth, straight)).heading == NO_ERRORS


def test_without_errors_a_path_is_left_unchanged() -> None:
    path = winding(5.0)
    assert HeadingErrors().removed_from(path.stamps_ns / NS, path.poses) is path.poses
