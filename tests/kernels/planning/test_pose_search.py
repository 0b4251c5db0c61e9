"""The search over poses against its reference implementation."""

from __future__ import annotations

import numpy as np
import pytest

from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.grid import cost_to_go, descend, pull_string
from gridslam.kernels.planning.search import (
    EXHAUSTED,
    FOUND,
    TOO_MANY,
    UNFINISHED,
    continue_search,
    motions_to_goal,
)
from gridslam.kernels.planning.search_states import COUNT, Query, start_search
from gridslam.planning.guide_path import poses_along_polyline
from gridslam.planning.space import distance_field
from tests.kernels.planning.limits import LIMITS
from tests.reference.pose_search import ReferencePoseSearch

RESOLUTION, RADIUS, MARGIN = 0.1, 0.15, 0.005


def world_with_wall(gap_cells: int = 8) -> CollisionWorld:
    """3 x 2 m with a wall in the middle that leaves a gap at its upper end."""
    blocked = np.zeros((20, 30), bool)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    blocked[: 19 - gap_cells, 15] = True
    discs = np.array([[0.0, 0.0, RADIUS]])
    return CollisionWorld(distance_field(blocked, RESOLUTION), blocked, RESOLUTION, discs, MARGIN)


def query(world: CollisionWorld, start: np.ndarray, goal: np.ndarray, reverse: bool) -> Query:
    cols = world.blocked.shape[1]
    first, last = (int(p[1] / RESOLUTION) * cols + int(p[0] / RESOLUTION) for p in (start, goal))
    cost = cost_to_go(world.field, RESOLUTION, RADIUS + MARGIN, 1.0, 0.3, last, first, np.inf)
    cells = descend(cost, first)
    points = np.vstack([start[:2], (cells[:, ::-1] + 0.5) * RESOLUTION, goal[:2]])
    return Query(
        goals=goal[None],
        guide_path=poses_along_polyline(pull_string(world, points)),
        cost_to_go=cost,
        limits=LIMITS,
        radius=0.3,
        step=0.15,
        bin_size=0.075,
        bin_yaws=64,
        reverse_cost=2.0 if reverse else np.inf,
    )


def searched(
    world: CollisionWorld, asked: Query, start: np.ndarray, max_states: int = 20_000, slice_size: int = 10**9
) -> tuple[int, np.ndarray, int]:
    states = start_search(asked, start, max_states)
    status = UNFINISHED
    while status == UNFINISHED:
        status = continue_search(world, asked, states, slice_size)
    return status, motions_to_goal(states) if status == FOUND else np.zeros((0, 2)), int(states.size[COUNT])


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("seed", [1, 3])
def test_motions_equal_those_of_the_reference(seed: int, reverse: bool) -> None:
    rng = np.random.default_rng(seed)
    world = world_with_wall()
    start = np.array([rng.uniform(0.4, 1.1), rng.uniform(0.4, 1.5), rng.uniform(-np.pi, np.pi)])
    goal = np.array([rng.uniform(1.9, 2.5), rng.uniform(0.4, 1.5), rng.uniform(-np.pi, np.pi)])
    asked = query(world, start, goal, reverse)
    expected = ReferencePoseSearch(world, asked, start).motions()
    status, motions, _ = searched(world, asked, start)
    assert status == (FOUND if expected is not None else EXHAUSTED)
    np.testing.assert_allclose(motions, np.array(expected or np.zeros((0, 2))), atol=1e-9)
    if expected is not None:
        pose = tuple(start)
        for motion in motions:
            pose = advance(*pose, *motion)
        np.testing.assert_allclose(pose[:2], goal[:2], atol=1e-6)


def random_problem(seed: int, reverse: bool) -> tuple[CollisionWorld, Query, np.ndarray]:
    """A map of 3 x 4 m with random blocked cells, a goal with either of two headings, and a start."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((30, 40)) < 0.02
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    discs = np.array([[0.0, 0.0, RADIUS]])
    world = CollisionWorld(distance_field(blocked, RESOLUTION), blocked, RESOLUTION, discs, MARGIN)
    is_open = np.argwhere(world.field[1::2, 1::2] >= RADIUS + MARGIN)
    goal, start = (is_open[rng.integers(len(is_open), size=2)][:, ::-1] + 0.5) * RESOLUTION
    yaws = rng.uniform(-np.pi, np.pi, 3)
    goals = np.array([[*goal, yaw] for yaw in yaws[:2]])
    start = np.array([*start, yaws[2]])
    return world, query(world, start, goals[0], reverse)._replace(goals=goals), start


@pytest.mark.parametrize(
    ("seed", "reverse"),
    [(0, True), (1, False), (2, False), (3, False), (3, True), (4, False), (4, True), (5, True)],
)
def test_motions_on_random_maps_equal_those_of_the_reference(seed: int, reverse: bool) -> None:
    world, asked, start = random_problem(seed, reverse)
    expected = ReferencePoseSearch(world, asked, start).motions()
    status, motions, _ = searched(world, asked, start, max_states=200_000, slice_size=100)
    assert status == (FOUND if expected is not None else EXHAUSTED)
    if expected is None:
        return
    np.testing.assert_allclose(motions, np.array(expected), atol=1e-9)
    pose = tuple(start)
    for length, curvature in expected:
        assert is_free(world, *pose, length, curvature)
        pose = advance(*pose, length, curvature)
    gaps = asked.goals - pose
    gaps[:, 2] = np.angle(np.exp(1j * gaps[:, 2]))
    assert np.abs(gaps).max(axis=1).min() < 1e-6


def test_slices_of_any_size_give_the_same_motions() -> None:
    world = world_with_wall()
    start, goal = np.array([0.6, 0.5, 0.0]), np.array([2.4, 0.5, -1.5])
    asked = query(world, start, goal, False)
    whole = searched(world, asked, start)
    for size in (1, 7, 500):
        status, motions, count = searched(world, asked, start, slice_size=size)
        assert (status, count) == (whole[0], whole[2])
        np.testing.assert_array_equal(motions, whole[1])


def test_a_search_without_room_for_more_states_says_so() -> None:
    world = world_with_wall()
    start, goal = np.array([0.6, 0.5, 0.0]), np.array([2.4, 0.5, -1.5])
    asked = query(world, start, goal, False)
    assert searched(world, asked, start, max_states=100)[0] == TOO_MANY
