from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.ir_scan.adjustment import adjust
from gridslam.methods.ir_scan.config import DrawingConfig
from gridslam.methods.ir_scan.stops import Factor, Place
from gridslam.methods.ir_scan.surfaces import draw_surfaces
from gridslam.motion.wheel_gyro import Stretch
from gridslam.sensors.infrared import RangeNoise, reliability, reliable_ends
from tests.methods.ir_scan.room import SEGMENTS, STOPS, scan_from

Floats = NDArray[np.float64]

NOISE = RangeNoise(0.005, 0.0, 0.003)
STEP = np.diag([0.02, 0.01, 0.02]) ** 2


def places(errors: Floats, true: Floats = STOPS, outliers: float = 0.0) -> list[Place]:
    """The start and the stops of a drive; each step's odometry is off by `errors` `(n, 3)`."""
    rng = np.random.default_rng(1)
    found = [Place(0, true[0].copy(), np.zeros((3, 3)), true[0].copy(), None)]
    for k, stop in enumerate(true):
        before = true[max(k - 1, 0)]
        step = se2.between(before, stop) + errors[k]
        pose = se2.compose(found[-1].pose, step)
        scan = scan_from(stop, rng, 0.005)
        wrong = rng.random(len(scan)) < outliers
        scan.range_m[wrong] = 0.5 * rng.random(int(wrong.sum())) + 0.2
        ends = reliable_ends(scan, reliability(scan, 0.1))
        stretch = Stretch(step, STEP, np.zeros(0, np.int64), np.zeros((0, 3)))
        found.append(Place(k + 1, pose, STEP, pose, stretch, True, scan, ends))
    return found


def drift(seed: int, count: int = len(STOPS)) -> Floats:
    errors = np.random.default_rng(seed).normal(0.0, [0.01, 0.005, 0.01], (count, 3))
    errors[0] = 0.0
    return errors


def off(poses: Floats) -> float:
    """Largest distance of a stop from its true place."""
    return float(np.hypot(*(poses[1:] - STOPS)[:, :2].T).max())


def test_stops_that_see_the_same_walls_are_put_right_together() -> None:
    for seed in range(3):
        ride = places(drift(seed))
        before, after = off(np.array([p.pose for p in ride])), off(adjust(ride, 0.1, 15, NOISE))
        assert after < 0.012
        assert after < 0.5 * before


def test_wrong_readings_change_little() -> None:
    ride = places(drift(5), outliers=0.05)
    assert off(adjust(ride, 0.1, 15, NOISE)) < 0.015


def test_without_readings_odometry_decides() -> None:
    ride = places(drift(0))
    for place in ride:
        place.ends = None
    assert np.array_equal(adjust(ride, 0.1, 15, NOISE), np.array([p.pose for p in ride]))


def test_the_first_place_stays_and_a_fix_moves_the_map() -> None:
    ride = places(drift(2))
    assert np.allclose(adjust(ride, 0.1, 15, NOISE)[0], ride[0].pose, atol=1e-6)
    shift = np.array([5.0, -2.0, 0.0])
    tight = np.diag([0.001, 0.001, 0.001]) ** 2
    for k in (0, 1, len(ride) - 1):
        ride[k].fixes.append(Factor(STOPS[max(k - 1, 0)] + shift, tight))
    poses = adjust(ride, 0.1, 30, NOISE)
    assert np.hypot(*(poses[1:] - STOPS - shift)[:, :2].T).max() < 0.015


def test_places_without_odometry_and_without_shared_walls_stay_where_fixes_put_them() -> None:
    ride = places(drift(0))
    for k, place in enumerate(ride):
        place.has_odometry = False
        place.pose = np.array([10.0 * k, 0.0, 0.0])
        if k:
            place.fixes.append(Factor(place.pose.copy(), STEP))
    before = np.array([p.pose for p in ride])
    assert np.allclose(adjust(ride, 0.1, 10, NOISE), before, atol=0.003)


def distance_to_walls(points: Floats) -> Floats:
    a, b = SEGMENTS[:, :2], SEGMENTS[:, 2:]
    share = np.clip(((points[:, None] - a) * (b - a)).sum(-1) / ((b - a) ** 2).sum(-1), 0, 1)
    return np.asarray(np.linalg.norm(points[:, None] - (a + share[..., None] * (b - a)), axis=-1).min(axis=1))


def test_the_drawn_walls_are_thin_and_true_and_lone_readings_are_no_walls() -> None:
    ride = places(np.zeros((len(STOPS), 3)), outliers=0.03)
    poses = np.array([p.pose for p in ride])
    made = draw_surfaces(ride, poses, DrawingConfig(), NOISE, 0.01, 100.0)
    walls = made.geometry.centres(np.argwhere(made.probability > 0.5))
    away = distance_to_walls(walls)
    assert len(walls) > 150
    assert away.mean() < 0.01
    assert away.max() < 0.06
    row, col = made.geometry.cells(np.array([[1.0, 0.3]]))[0]
    assert made.probability[row, col] < 0.196
    outside = made.geometry.cells(np.array([[1.5, 1.4]]))[0]
    assert np.isnan(made.probability[tuple(outside)])  # inside of the box


def test_no_readings_make_an_empty_map() -> None:
    ride = places(np.zeros((1, 3)), STOPS[:1])
    ride[1].ends = None
    made = draw_surfaces(ride, np.zeros((2, 3)), DrawingConfig(), NOISE, 0.01, 100.0)
    assert made.probability.size == 0
