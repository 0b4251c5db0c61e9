from __future__ import annotations

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry, Range
from gridslam.simulation.driving.scripted import LASER_X_M, Noise, ranges_from, scripted_log, true_path, walls


def test_ranges_are_the_distances_to_the_walls_ahead() -> None:
    pose = np.array([2.0, 1.5, 0.0])
    ahead, left, back, right = ranges_from(pose, np.array([0.0, np.pi / 2, np.pi, -np.pi / 2]))
    assert np.allclose([ahead, left, back, right], [12.0, 7.5, 2.0, 1.5], atol=1e-12)


def test_every_end_point_lies_on_a_wall() -> None:
    pose = np.array([11.3, 7.1, 0.4])
    bearings = np.linspace(-np.pi, np.pi, 97)
    ends = se2.transform_points(
        pose, ranges_from(pose, bearings)[:, None] * np.c_[np.cos(bearings), np.sin(bearings)]
    )
    a, b = walls()[:, :2], walls()[:, 2:]
    fraction = np.clip(((ends[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0, 1)
    distance = np.linalg.norm(ends[:, None] - (a + fraction[..., None] * (b - a)), axis=-1).min(axis=1)
    assert distance.max() < 1e-9


def test_the_path_is_closed_and_keeps_clear_of_the_walls() -> None:
    path = true_path(laps=2)
    assert np.allclose(path[-1, :2], path[0, :2])
    assert np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).max() < 0.07
    all_around = np.linspace(-np.pi, np.pi, 36)
    assert min(ranges_from(pose, all_around).min() for pose in path[::20]) > 0.8


def test_without_noise_the_log_is_exact() -> None:
    noise = Noise(range_m=0.0, translation=0.0, rotation=0.0, scale=1.0, drift_rad=0.0)
    events = list(scripted_log(laps=1, beams=20, noise=noise))
    odometry = [(event, truth) for event, truth in events if isinstance(event, Odometry)]
    first, last = odometry[0][1], odometry[-1][1]
    assert first is not None
    assert last is not None
    assert np.allclose(odometry[-1][0].pose, se2.between(first.pose, last.pose), atol=1e-9)
    scans = [event for event, _ in events if isinstance(event, LaserScan)]
    exact = ranges_from(se2.compose(last.pose, [LASER_X_M, 0, 0]), np.linspace(-np.pi / 2, np.pi / 2, 20))
    assert np.array_equal(scans[-1].ranges_m, exact.astype(np.float32))


def test_an_infrared_ranger_sweeps_between_two_odometry_messages() -> None:
    noise = Noise(range_m=0.0, translation=0.0, rotation=0.0, scale=1.0, drift_rad=0.0)
    pose = np.zeros(3)
    sweeps = 0
    for event, truth in scripted_log(laps=1, beams=20, noise=noise):
        if truth is not None:
            pose = truth.pose
        elif isinstance(event, Range):
            sweeps += event.bearing_rad == np.radians(-60.0)
            assert event.range_m == np.float32(ranges_from(pose, np.array([event.bearing_rad]))[0])
    assert sweeps > 5
