from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.ir_scan.adjustment import adjust
from gridslam.methods.ir_scan.stops import MeasuredPose, Stop
from gridslam.methods.ir_scan.surfaces import draw_surfaces
from gridslam.motion.wheel_gyro import RelativeMotion
from gridslam.sensors.infrared import RangeNoise, reliability, reliable_readings
from tests.methods.ir_scan.room import SEGMENTS, STOPS, scan_from

Floats = NDArray[np.float64]

NOISE = RangeNoise(0.005, 0.0, 0.003)
STEP = np.diag([0.02, 0.01, 0.02]) ** 2


def drive(errors: Floats, true: Floats = STOPS, outliers: float = 0.0) -> list[Stop]:
    """The start and the stops of a drive; `errors` `(n, 3)` are those of the odometry of each step."""
    rng = np.random.default_rng(1)
    found = [Stop(0, true[0].copy(), np.zeros((3, 3)), true[0].copy(), None)]
    for k, true_pose in enumerate(true):
        before = true[max(k - 1, 0)]
        step = se2.between(before, true_pose) + errors[k]
        pose = se2.compose(found[-1].pose, step)
        scan = scan_from(true_pose, rng, 0.005)
        wrong = rng.random(len(scan)) < outliers
        scan.range_m[wrong] = 0.5 * rng.random(int(wrong.sum())) + 0.2
        readings = reliable_readings(scan, reliability(scan, 0.1))
        motion = RelativeMotion(step, STEP, np.zeros(0, np.int64), np.zeros((0, 3)))
        found.append(Stop(k + 1, pose, STEP, pose, motion, scan=scan, readings=readings))
    return found


def drift(seed: int, count: int = len(STOPS)) -> Floats:
    errors = np.random.default_rng(seed).normal(0.0, [0.01, 0.005, 0.01], (count, 3))
    errors[0] = 0.0
    return errors


def max_error(poses: Floats) -> float:
    """Largest distance (m) of a stop from its true position."""
    return float(np.hypot(*(poses[1:] - STOPS)[:, :2].T).max())


def test_stops_with_common_walls_are_corrected_together() -> None:
    for seed in range(3):
        stops = drive(drift(seed))
        before, after = max_error(np.array([p.pose for p in stops])), max_error(adjust(stops, 0.1, NOISE))
        assert after < 0.012
        assert after < 0.5 * before


def test_outliers_change_little() -> None:
    stops = drive(drift(5), outliers=0.05)
    assert max_error(adjust(stops, 0.1, NOISE)) < 0.015


def test_without_readings_odometry_decides() -> None:
    stops = drive(drift(0))
    for stop in stops:
        stop.readings = None
    assert np.array_equal(adjust(stops, 0.1, NOISE), np.array([p.pose for p in stops]))


def test_the_first_stop_is_held_and_absolute_poses_move_the_map() -> None:
    stops = drive(drift(2))
    assert np.allclose(adjust(stops, 0.1, NOISE)[0], stops[0].pose, atol=1e-6)
    shift = np.array([5.0, -2.0, 0.0])
    tight = np.diag([0.001, 0.001, 0.001]) ** 2
    for k in (0, 1, len(stops) - 1):
        stops[k].absolute_poses.append(MeasuredPose(STOPS[max(k - 1, 0)] + shift, tight))
    poses = adjust(stops, 0.1, NOISE)
    assert np.hypot(*(poses[1:] - STOPS - shift)[:, :2].T).max() < 0.015


def test_stops_without_odometry_and_common_walls_keep_their_absolute_poses() -> None:
    stops = drive(drift(0))
    for k, stop in enumerate(stops):
        stop.has_odometry = False
        stop.pose = np.array([10.0 * k, 0.0, 0.0])
        if k:
            stop.absolute_poses.append(MeasuredPose(stop.pose.copy(), STEP))
    before = np.array([p.pose for p in stops])
    assert np.allclose(adjust(stops, 0.1, NOISE), before, atol=0.003)


def distance_to_walls(points: Floats) -> Floats:
    a, b = SEGMENTS[:, :2], SEGMENTS[:, 2:]
    fraction = np.clip(((points[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0, 1)
    return np.asarray(
        np.linalg.norm(points[:, None] - (a + fraction[..., None] * (b - a)), axis=-1).min(axis=1)
    )


def test_drawn_walls_are_thin_and_true_and_lone_readings_draw_no_wall() -> None:
    stops = drive(np.zeros((len(STOPS), 3)), outliers=0.03)
    poses = np.array([p.pose for p in stops])
    occupancy = draw_surfaces(stops, poses, NOISE, 0.01, 100.0)
    walls = occupancy.geometry.centres(np.argwhere(occupancy.probability > 0.5))
    distance = distance_to_walls(walls)
    assert len(walls) > 150
    assert distance.mean() < 0.01
    assert distance.max() < 0.06
    row, col = occupancy.geometry.cells(np.array([[1.0, 0.3]]))[0]
    assert occupancy.probability[row, col] < 0.196
    outside = occupancy.geometry.cells(np.array([[1.5, 1.4]]))[0]
    assert np.isnan(occupancy.probability[tuple(outside)])  # inside the box


def test_no_readings_give_an_empty_map() -> None:
    stops = drive(np.zeros((1, 3)), STOPS[:1])
    stops[1].readings = None
    occupancy = draw_surfaces(stops, np.zeros((2, 3)), NOISE, 0.01, 100.0)
    assert occupancy.probability.size == 0
