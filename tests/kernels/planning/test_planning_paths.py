"""The kernels that turn costs into paths and improve paths and tours, against their reference implementations."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.planning.circles import chain_parts, minimise_travel_time, parts_are_free, travel_time
from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.drive_limits import speed_on
from gridslam.kernels.planning.grid import cost_to_go, descend, pull_string
from gridslam.kernels.planning.shortcut import JOINT_COST_S, shortcut
from gridslam.kernels.planning.shortest_tour import improved_tour
from gridslam.planning.space import distance_field
from tests.kernels.planning.limits import LIMITS
from tests.reference import planning_paths as reference

RESOLUTION, RADIUS, MARGIN = 0.1, 0.1, 0.005


def world(seed: int, occupied_fraction: float = 0.01) -> CollisionWorld:
    """4 x 5 m with random blocked cells and a closed border."""
    blocked = np.random.default_rng(seed).random((40, 50)) < occupied_fraction
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    field = distance_field(blocked, RESOLUTION)
    return CollisionWorld(field, blocked, RESOLUTION, np.array([[0.0, 0.0, RADIUS]]), MARGIN)


def costs(here: CollisionWorld, seed: int) -> tuple[np.ndarray, tuple[int, int]]:
    """The cost to go to one random open cell, and another open cell with a cost."""
    rng = np.random.default_rng(seed)
    is_open = np.argwhere(here.field[1::2, 1::2] >= RADIUS + MARGIN)
    (row, col), (start_row, start_col) = is_open[rng.integers(len(is_open), size=2)]
    cols = here.blocked.shape[1]
    cost = cost_to_go(
        field=here.field,
        resolution=RESOLUTION,
        required=RADIUS + MARGIN,
        obstacle_weight=1.5,
        inflation_radius=0.4,
        goal=row * cols + col,
        start=start_row * cols + start_col,
        search_factor=np.inf,
    )
    assert np.isfinite(cost[start_row, start_col])
    return cost, (int(start_row), int(start_col))


@pytest.mark.parametrize("seed", range(5))
def test_the_descent_takes_the_largest_drop(seed: int) -> None:
    cost, start = costs(world(seed), seed)
    cells = descend(cost, start[0] * cost.shape[1] + start[1])
    assert [tuple(cell) for cell in cells.tolist()] == reference.descend(cost, start)


@pytest.mark.parametrize("seed", range(5))
def test_a_pulled_string_is_a_shorter_free_polyline_over_some_of_the_points(seed: int) -> None:
    here = world(seed)
    cost, start = costs(here, seed)
    points = (descend(cost, start[0] * cost.shape[1] + start[1])[:, ::-1] + 0.5) * RESOLUTION
    corners = pull_string(here, points)
    rows = [int(np.flatnonzero((points == corner).all(axis=1))[0]) for corner in corners]
    assert rows[0] == 0 and rows[-1] == len(points) - 1
    assert (np.diff(rows) > 0).all()
    for (x, y), (dx, dy) in zip(corners[:-1], np.diff(corners, axis=0), strict=True):
        assert is_free(here, x, y, np.arctan2(dy, dx), np.hypot(dx, dy), 0.0)
    lengths = [np.hypot(*np.diff(line, axis=0).T).sum() for line in (corners, points)]
    assert lengths[0] <= lengths[1] + 1e-9


@pytest.mark.parametrize("seed", range(6))
def test_shortcuts_take_the_time_of_the_best_chain(seed: int) -> None:
    rng = np.random.default_rng(seed)
    here = world(seed, occupied_fraction=0.002)
    start = np.array([1.0, 1.5, 0.3])
    motions = np.column_stack([rng.uniform(0.2, 0.9, 6), rng.choice([0.0, 1.5, -1.5, 3.0, -3.0], 6)])
    arguments = (here, start, motions, np.array([0.3, 0.6]), LIMITS, 0.25, 12)
    found = shortcut(*arguments)
    pose, given = tuple(start), tuple(start)
    for motion in found:
        pose = advance(*pose, *motion)
    for motion in motions:
        given = advance(*given, *motion)
    np.testing.assert_allclose(pose[:2], given[:2], atol=1e-6)
    driven = sum(length / speed_on(curvature, LIMITS) for length, curvature in found)
    best = reference.shortcut_time(*arguments)
    # The reference counts a joint's cost a piece; the kernel's motions are pieces merged, so only the driving time is bounded.
    pieces = len(reference.joints_along(start, motions, 0.25)[1])
    assert best - pieces * JOINT_COST_S - 1e-6 <= driven <= best - JOINT_COST_S + 1e-6


@pytest.mark.parametrize("seed", range(5))
def test_no_reversal_or_move_of_places_shortens_an_improved_tour(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.0, 10.0, (12, 2))
    distances = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    order = improved_tour(distances, np.arange(12))
    assert order[0] == 0 and sorted(order) == list(range(12))
    assert reference.improving_moves(distances, order.tolist()) == 0


@pytest.mark.parametrize("seed", range(5))
def test_the_local_search_over_circles_takes_less_time_and_remains_free(seed: int) -> None:
    rng = np.random.default_rng(seed)
    here = world(seed, occupied_fraction=0.0)
    start, goal = np.array([0.8, 0.8, 0.5]), np.array([4.0, 3.0, rng.uniform(-1.0, 1.0)])
    middle = [rng.uniform(2.0, 3.0), rng.uniform(1.2, 2.8), 0.3, rng.choice([-1.0, 1.0])]
    circles = np.array([[0.0, 0.0, 0.3, 1.0], middle, [0.0, 0.0, 0.3, -1.0]])
    given = np.empty((5, 6))
    assert chain_parts(circles, 3, start, goal, given) and parts_are_free(here, given, 0, 5)
    better, time = minimise_travel_time(
        world=here,
        circles=circles,
        start=start,
        goal=goal,
        radius=0.3,
        limits=LIMITS,
        first_step=0.32,
        last_step=0.01,
    )
    parts = np.empty((2 * len(better) - 1, 6))
    assert chain_parts(better, len(better), start, goal, parts)
    assert parts_are_free(here, parts, 0, len(parts))
    assert travel_time(parts, LIMITS, np.empty(len(parts) + 1)) == pytest.approx(time)
    assert time <= travel_time(given, LIMITS, np.empty(6))
    assert (better[:, 2] >= 0.3 - 1e-12).all()
    pose = tuple(parts[-1, :3])
    end = advance(*pose, parts[-1, 3], parts[-1, 4])
    np.testing.assert_allclose(end[:2], goal[:2], atol=1e-6)
