"""Points and normals of a scan."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from gridslam.core import poses as se2
from gridslam.kernels.scan_matching import scan_points
from gridslam.kernels.scan_matching.scan_points import RangeLimits, Sweep
from tests.reference import scan_points as reference


@given(seed=st.integers(0, 10_000), n=st.integers(0, 60))
@settings(max_examples=60, deadline=None)
def test_points_are_the_usable_readings_transformed_by_the_extrinsics(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    ranges = rng.choice([0.02, 0.5, 3.0, 29.0, 31.0, np.nan, np.inf, -1.0], n).astype(np.float32)
    extrinsics = rng.uniform(-1.0, 1.0, 3)
    sweep, limits = Sweep(-1.5, 0.05, 0.0), RangeLimits(0.05, 30.0)
    points, beams = scan_points.scan_to_points(ranges, sweep, limits, extrinsics, np.zeros(3))
    with np.errstate(invalid="ignore"):
        expected, usable = reference.scan_to_points(ranges, -1.5, 0.05, 0.05, 30.0, extrinsics)
    np.testing.assert_array_equal(beams, usable)
    np.testing.assert_allclose(points, expected, atol=1e-9)


def test_the_plane_of_a_tilted_lidar_is_seen_from_above() -> None:
    ranges, limits = np.array([2.0, 3.0, 4.0], np.float32), RangeLimits(0.05, 30.0)
    projection = scan_points.Projection(0.9, 0.05, 0.8)
    sweep = Sweep(-1.0, 0.7, 0.0, projection)
    points, _ = scan_points.scan_to_points(ranges, sweep, limits, np.array([0.3, 0.1, 0.4]), np.zeros(3))
    angles = -1.0 + 0.7 * np.arange(3)
    seen = np.array([[0.9, 0.05], [0.0, 0.8]]) @ (ranges * np.stack([np.cos(angles), np.sin(angles)]))
    np.testing.assert_allclose(points, se2.transform_points(np.array([0.3, 0.1, 0.4]), seen.T), atol=1e-6)


def test_the_motion_during_the_sweep_is_removed() -> None:
    twist, increment = np.array([0.8, 0.0, 1.2]), 0.001
    landmarks = np.array([[2.0, -1.0], [2.5, 0.3], [1.5, 1.2]])
    angles, ranges, when = [], np.zeros(201, np.float32), []
    for landmark in landmarks:  # which beam meets it while the robot moves along its arc
        best = min(range(201), key=lambda i: abs(off(landmark, i, twist, increment)))
        pose = arc(twist, best * increment)
        ranges[best] = np.hypot(*se2.transform_points(se2.inverse(pose), landmark[None])[0])
        angles.append(best)
        when.append(pose)
    sweep, limits = Sweep(-1.0, 0.01, increment), RangeLimits(0.05, 30.0)
    points, beams = scan_points.scan_to_points(ranges, sweep, limits, np.zeros(3), twist)
    assert beams.tolist() == sorted(angles)
    np.testing.assert_allclose(points, landmarks, atol=0.02)


def arc(twist: np.ndarray, seconds: float) -> np.ndarray:
    """Where the robot is after driving at constant velocity, by the exact arc."""
    v, w = twist[0], twist[2]
    yaw = w * seconds
    return np.array([v / w * np.sin(yaw), v / w * (1.0 - np.cos(yaw)), yaw])


def off(landmark: np.ndarray, beam: int, twist: np.ndarray, increment: float) -> float:
    local = se2.transform_points(se2.inverse(arc(twist, beam * increment)), landmark[None])[0]
    return float(np.arctan2(local[1], local[0]) - (-1.0 + 0.01 * beam))


def test_normals_of_a_wall_stand_on_it_and_face_the_lidar() -> None:
    bearings = np.linspace(-1.0, 1.0, 101)
    points = np.stack([np.full(101, 2.0), 2.0 * np.tan(bearings)], axis=1)
    normals = scan_points.surface_normals(points, np.arange(101), np.zeros(2))
    np.testing.assert_allclose(normals, np.tile([-1.0, 0.0], (101, 1)), atol=1e-9)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_normals_are_those_of_the_neighbours_covariance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bearings = np.sort(rng.uniform(-3.0, 3.0, 120))
    wall = np.minimum(
        3.0 / np.maximum(np.abs(np.cos(bearings)), 0.1), 2.0 / np.maximum(np.abs(np.sin(bearings)), 0.1)
    )
    ranges = wall + rng.normal(0.0, 0.01, 120)
    points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)
    beams, eye = np.cumsum(rng.integers(1, 9, 120)), rng.uniform(-0.2, 0.2, 2)
    normals = scan_points.surface_normals(points, beams, eye)
    np.testing.assert_allclose(normals, reference.surface_normals(points, beams, eye), atol=1e-6)


def test_scattered_points_have_no_normal() -> None:
    points = np.random.default_rng(0).uniform(-0.15, 0.15, (40, 2)) + np.array([3.0, 0.0])
    normals = scan_points.surface_normals(points, np.arange(40), np.zeros(2))
    assert (normals == 0.0).all(axis=1).mean() > 0.8


def test_points_between_the_returns_lie_on_the_wall_no_farther_apart_than_asked() -> None:
    points = np.stack([np.arange(0.0, 6.0, 0.8), np.full(8, 1.5)], axis=1)
    normals = np.tile([0.0, -1.0], (8, 1))
    chords = scan_points.surface_chords(points, normals, 1.0)
    filled, filled_normals = scan_points.fill_chords(points, normals, chords, 0.1)
    assert chords.tolist() == [*[True] * 7, False]
    assert np.diff(filled[:, 0]).max() <= 0.1 + 1e-9
    np.testing.assert_allclose(filled[:, 1], 1.5)
    np.testing.assert_allclose(filled_normals, np.tile([0.0, -1.0], (len(filled), 1)))
