"""The planner's kernels against their reference implementations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gridslam.kernels.planning.circles import chain_parts, travel_time
from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free, wall_distance
from gridslam.kernels.planning.dubins import WORDS, dubins_words
from gridslam.kernels.planning.grid import cost_to_go
from gridslam.planning.space import distance_field
from tests.kernels.planning.limits import LIMITS
from tests.reference import planning_grid as reference

Floats = NDArray[np.float64]
RESOLUTION = 0.1


def world(seed: int, occupied_fraction: float = 0.03, radius: float = 0.2) -> CollisionWorld:
    blocked = np.random.default_rng(seed).random((40, 50)) < occupied_fraction
    field = distance_field(blocked, RESOLUTION)
    return CollisionWorld(field, blocked, RESOLUTION, np.array([[0.0, 0.0, radius]]), 0.005)


def to_squares(blocked: NDArray[np.bool_], points: Floats) -> Floats:
    return reference.distance_to_squares(blocked, RESOLUTION, points)


def test_the_field_is_the_distance_to_the_nearest_square() -> None:
    here = world(0)
    rows, cols = np.mgrid[: here.field.shape[0], : here.field.shape[1]]
    points = np.stack([cols.ravel(), rows.ravel()], axis=1) * 0.5 * RESOLUTION
    np.testing.assert_allclose(here.field.ravel(), to_squares(here.blocked, points), atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_distance_is_never_too_long_and_decides_the_required_clearance(seed: int) -> None:
    here = world(seed)
    points = np.random.default_rng(seed).uniform(0.0, 4.0, (2000, 2))
    for (x, y), true in zip(points, to_squares(here.blocked, points), strict=True):
        found = wall_distance(here, x, y, 0.2)
        assert found <= true + 1e-6
        if abs(true - 0.2) > 1e-6:
            assert (found >= 0.2) == (true >= 0.2)


@pytest.mark.parametrize("curvature", [0.0, 2.0, -5.0])
def test_a_drive_is_free_if_all_its_places_are(curvature: float) -> None:
    here = world(5, occupied_fraction=0.01)
    rng = np.random.default_rng(6)
    results = []
    for pose in rng.uniform([0.3, 0.3, -np.pi], [4.7, 3.7, np.pi], (600, 3)):
        length = float(rng.uniform(-1.5, 1.5))
        distances = np.linspace(0.0, length, 400)
        places = np.array([advance(*pose, distance, curvature)[:2] for distance in distances])
        if places.min() < 0.3 or (places > [4.7, 3.7]).any():
            continue  # everything off the grid is blocked
        lowest = to_squares(here.blocked, places).min()
        free = is_free(here, *pose, length, curvature)
        results.append(free)
        if free:
            assert lowest >= 0.2 - 1e-6
        else:
            assert lowest < 0.205 + 0.005  # refused only within the margin, up to the spacing of the samples
    assert 0.1 < np.mean(results) < 0.95


def test_every_dubins_word_ends_at_the_goal() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        start, goal = rng.uniform([-3, -3, -np.pi], [3, 3, np.pi], (2, 3))
        radius = float(rng.uniform(0.2, 1.5))
        parts, total = dubins_words(start, goal, radius)
        for word in np.flatnonzero(np.isfinite(total)):
            pose = tuple(start)
            for length, side in zip(parts[word], WORDS[word], strict=True):
                pose = advance(*pose, length, side / radius)
            np.testing.assert_allclose(pose[:2], goal[:2], atol=1e-9)
            assert abs(np.angle(np.exp(1j * (pose[2] - goal[2])))) < 1e-9


def test_no_sampled_chain_is_shorter_than_the_shortest_word() -> None:
    # CSC and CCC words contain the optimum (Dubins 1957): no sampled arc-line-arc may be shorter.
    rng = np.random.default_rng(1)
    start, goal = np.array([0.0, 0.0, 0.3]), np.array([2.0, 1.0, -1.0])
    _, total = dubins_words(start, goal, 0.5)
    shortest = np.inf
    for signs in [(1, 1), (1, -1), (-1, 1), (-1, -1)]:
        for first_angle in rng.uniform(0.0, 2.0 * np.pi, 400):
            x, y, yaw = advance(*start, first_angle * 0.5, signs[0] / 0.5)
            for distance in np.linspace(0.0, 4.0, 41):
                end = np.array([x + distance * np.cos(yaw), y + distance * np.sin(yaw)])
                second = (signs[1] * (goal[2] - yaw)) % (2.0 * np.pi)
                last = advance(*end, yaw, second * 0.5, signs[1] / 0.5)
                if np.hypot(last[0] - goal[0], last[1] - goal[1]) < 0.05:
                    shortest = min(shortest, 0.5 * first_angle + distance + 0.5 * second)
    assert total.min() <= shortest + 0.1


def test_the_cost_to_go_equals_that_of_the_graph_of_neighbours() -> None:
    here = world(3, occupied_fraction=0.05)
    required, obstacle_weight, inflation_radius = 0.1, 2.0, 0.3
    clearance = here.field[1::2, 1::2] - required
    source = int(np.flatnonzero(clearance.ravel() >= 0.0)[0])
    expected = reference.cost_to_go(
        here.field, RESOLUTION, required, obstacle_weight, inflation_radius, source
    )
    found = cost_to_go(
        here.field, RESOLUTION, required, obstacle_weight, inflation_radius, source, source, np.inf
    )
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_circles_are_joined_by_their_tangents() -> None:
    rng = np.random.default_rng(8)
    joined = 0
    for _ in range(200):
        circles = np.column_stack(
            [rng.uniform(-3, 3, (4, 2)), rng.uniform(0.1, 0.8, 4), rng.choice([-1.0, 1.0], 4)]
        )
        start, goal = rng.uniform([-3, -3, -np.pi], [3, 3, np.pi], (2, 3))
        parts = np.empty((7, 6))
        if not chain_parts(circles, 4, start, goal, parts):
            continue
        joined += 1
        pose = tuple(start)
        for part in parts:
            np.testing.assert_allclose(pose[:2], part[:2], atol=1e-6)
            assert abs(np.angle(np.exp(1j * (pose[2] - part[2])))) < 1e-6
            pose = advance(*part[:3], part[3], part[4])
        np.testing.assert_allclose(pose[:2], goal[:2], atol=1e-6)
    assert joined > 20


def test_the_travel_time_equals_that_of_small_steps_at_the_allowed_speed() -> None:
    rng = np.random.default_rng(9)
    for _ in range(20):
        parts = np.zeros((6, 6))
        parts[:, 3] = rng.uniform(0.05, 2.0, 6)
        parts[:, 4] = rng.choice([0.0, 0.5, -2.0, 5.0], 6)
        expected = reference.travel_time(parts[:, 3], parts[:, 4], LIMITS[:5])
        assert travel_time(parts, LIMITS, np.empty(7)) == pytest.approx(expected, rel=2e-3)


def test_a_turn_on_the_spot_takes_the_time_of_a_trapezoidal_yaw_rate_profile() -> None:
    parts = np.zeros((1, 6))
    parts[0, 5] = np.pi  # up to 1.5 rad/s within 0.75 s: pi / 1.5 + 0.75 s
    assert travel_time(parts, LIMITS, np.empty(2)) == pytest.approx(np.pi / 1.5 + 0.75)
    parts[0, 5] = -0.5  # half distance at 2 rad/s^2: 2 sqrt(0.5 / 2)
    assert travel_time(parts, LIMITS, np.empty(2)) == pytest.approx(1.0)
