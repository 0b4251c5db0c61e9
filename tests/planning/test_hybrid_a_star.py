"""The planner's search over poses against its reference implementation, on small random maps."""

from __future__ import annotations

import math
from itertools import groupby

import numpy as np
import pytest

from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free
from gridslam.kernels.planning.drive_limits import DriveLimits
from gridslam.kernels.planning.grid import cost_to_go, descend, pull_string
from gridslam.kernels.planning.search import EXHAUSTED, FOUND, UNFINISHED, continue_search, motions_to_goal
from gridslam.kernels.planning.search_states import Query, start_search
from gridslam.planning.guide_path import poses_along_polyline
from gridslam.planning.space import distance_field
from tests.reference.hybrid_a_star import HybridAStar, Motions, Pose

RESOLUTION, ROBOT, MARGIN, RADIUS = 0.1, 0.15, 0.005, 0.4
LIMITS = DriveLimits(
    top_speed=1.0,
    lateral_acceleration=0.5,
    yaw_rate=1.5,
    acceleration=0.5,
    deceleration=0.5,
    yaw_acceleration=2.0,
)


def problem(seed: int, reverse: bool) -> tuple[CollisionWorld, Query, Pose]:
    """A map of 3 x 4 m with random blocked cells, a goal with one of two headings, and a start."""
    rng = np.random.default_rng(seed)
    blocked = rng.random((30, 40)) < 0.02
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    here = CollisionWorld(
        distance_field(blocked, RESOLUTION), blocked, RESOLUTION, np.array([[0.0, 0.0, ROBOT]]), MARGIN
    )
    is_open = np.argwhere(here.field[1::2, 1::2] >= ROBOT + MARGIN)
    goal, start = is_open[rng.integers(len(is_open), size=2)]
    cost = cost_to_go(
        field=here.field,
        resolution=RESOLUTION,
        required=ROBOT + MARGIN,
        obstacle_weight=1.5,
        inflation_radius=0.4,
        goal=goal[0] * 40 + goal[1],
        start=start[0] * 40 + start[1],
        search_factor=np.inf,
    )
    cells = descend(cost, start[0] * 40 + start[1])
    corners = pull_string(here, (cells[:, ::-1] + 0.5) * RESOLUTION)
    yaws = rng.uniform(-math.pi, math.pi, 3)
    goals = np.array([[*(goal[::-1] + 0.5) * RESOLUTION, yaw] for yaw in yaws[:2]])
    query = Query(
        goals=goals,
        guide_path=poses_along_polyline(corners),
        cost_to_go=cost,
        limits=LIMITS,
        radius=RADIUS,
        step=0.2,
        bin_size=0.1,
        bin_yaws=36,
        reverse_cost=1.0 if reverse else np.inf,
    )
    x, y = (start[::-1] + 0.5) * RESOLUTION
    return here, query, (float(x), float(y), float(yaws[2]))


def merged(motions: Motions) -> np.ndarray:
    """Motions `(n, 2)` of which neighbours of one curvature and direction are one."""
    groups = groupby(motions, key=lambda motion: (motion[1], motion[0] > 0.0))
    return np.array([(sum(length for length, _ in group), key[0]) for key, group in groups])


@pytest.mark.parametrize(
    ("seed", "reverse"),
    [(0, True), (1, False), (2, False), (3, False), (3, True), (4, False), (4, True), (5, True)],
)
def test_the_search_finds_the_path_of_the_reference(seed: int, reverse: bool) -> None:
    here, query, start = problem(seed, reverse)
    expected = HybridAStar(here, query, start).run()
    states = start_search(query, np.array(start), 200_000)
    status = UNFINISHED
    while status == UNFINISHED:
        status = continue_search(here, query, states, 100)
    assert status == (EXHAUSTED if expected is None else FOUND)
    if expected is None:
        return
    np.testing.assert_allclose(motions_to_goal(states), merged(expected), atol=1e-9)
    pose = start
    for length, curvature in expected:
        assert is_free(here, *pose, length, curvature)
        pose = advance(*pose, length, curvature)
    gaps = query.goals - pose
    gaps[:, 2] = np.angle(np.exp(1j * gaps[:, 2]))
    assert np.abs(gaps).max(axis=1).min() < 1e-6
