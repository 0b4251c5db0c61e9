"""The kernels of planning and exploring against their reference implementations, on a map of 60 x 80 cells."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.kernels.grids.visibility import pass_beams
from gridslam.kernels.planning import clearance
from gridslam.kernels.planning.circles import travel_time
from gridslam.kernels.planning.fast_marching import arrival_costs
from gridslam.kernels.planning.grid import cost_to_go
from gridslam.kernels.planning.shortest_tour import exact_tour
from gridslam.kernels.planning.wheel_window import free_distances
from gridslam.planning.art_gallery import gallery_of
from gridslam.planning.space import distance_field
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.kernel_pairs import Pair, rows_of_pairs
from tests.kernels.planning.limits import LIMITS
from tests.reference import planning as reference
from tests.reference import planning_grid as grid_reference
from tests.reference import visibility as visibility_reference

ALONE = True

SHAPE, RESOLUTION_M, RADIUS_M = (60, 80), 0.1, 0.2


def rows() -> Iterator[BenchmarkRow]:
    """Costs, clearances, tours, visibility, and times."""
    rng = np.random.default_rng(0)
    return rows_of_pairs(
        (
            ("arrival_costs", 150.0, arrival(rng)),
            ("cost_to_go", 40.0, cost(rng)),
            ("is_free", 25.0, drives(rng)),
            ("travel_time", 10000.0, times(rng)),
            ("exact_tour", 500.0, tour(rng)),
            ("visible_faces", 70.0, visibility(rng)),
            ("pass_beams", 100.0, beams(rng)),
            ("free_distances", 1500.0, free(rng)),
        )
    )


def arrival(rng: np.random.Generator) -> Pair:
    """Fast marching over 30 x 40 cells, against sweeps until convergence."""
    cell_cost = rng.uniform(1.0, 4.0, (30, 40))
    cell_cost[rng.random(cell_cost.shape) < 0.1] = np.inf
    cell_cost[15, 20] = 1.0
    in_single, source = cell_cost.astype(np.float32), np.array([15 * 40 + 20])
    return (
        lambda: arrival_costs(in_single, source, -1, np.inf),
        lambda: reference.eikonal_by_sweeps(cell_cost, [(15, 20)]),
    )


def world(rng: np.random.Generator) -> clearance.CollisionWorld:
    """A map with obstacles, and a round robot."""
    blocked = rng.random(SHAPE) < 0.01
    discs = np.array([[0.0, 0.0, RADIUS_M]])
    return clearance.CollisionWorld(
        distance_field(blocked, RESOLUTION_M), blocked, RESOLUTION_M, discs, 0.005
    )


def cost(rng: np.random.Generator) -> Pair:
    """The cost-to-go, against scipy's shortest paths on the graph of all cells."""
    field = world(rng).field
    goal = int(np.flatnonzero(field[1::2, 1::2].ravel() > 0.3)[0])
    setting = (field, RESOLUTION_M, 0.1, 2.0, 0.3, goal)
    return lambda: cost_to_go(*setting, goal, np.inf), lambda: grid_reference.cost_to_go(*setting)


def drives(rng: np.random.Generator) -> Pair:
    """Whether an arc of 1.5 m is free, against the distances of a hundred places on it to all squares; 50 arcs."""
    here = world(rng)
    poses = rng.uniform([1.0, 1.0, -np.pi], [7.0, 5.0, np.pi], (50, 3))
    curvatures = rng.uniform(-2.0, 2.0, 50)

    def sampled() -> list[bool]:
        free = []
        for pose, curvature in zip(poses, curvatures, strict=True):
            distances = np.linspace(0.0, 1.5, 100)
            places = np.array([clearance.advance(*pose, distance, curvature)[:2] for distance in distances])
            distances = grid_reference.distance_to_squares(here.blocked, RESOLUTION_M, places)
            free.append(bool(distances.min() >= RADIUS_M))
        return free

    def kernel() -> list[bool]:
        return [
            clearance.is_free(here, *pose, 1.5, curvature)
            for pose, curvature in zip(poses, curvatures, strict=True)
        ]

    return kernel, sampled


def times(rng: np.random.Generator) -> Pair:
    """The time of a path of six arcs and lines, against small steps."""
    parts = np.zeros((6, 6))
    parts[:, 3] = rng.uniform(0.05, 2.0, 6)
    parts[:, 4] = rng.choice([0.0, 0.5, -2.0, 5.0], 6)
    speeds, limits = np.empty(7), LIMITS[:5]
    return (
        lambda: travel_time(parts, LIMITS, speeds),
        lambda: grid_reference.travel_time(parts[:, 3], parts[:, 4], limits),
    )


def tour(rng: np.random.Generator) -> Pair:
    """The optimal tour through eight places, against all orders."""
    places = rng.uniform(0.0, 10.0, (8, 2))
    distances = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    return lambda: exact_tour(distances), lambda: reference.shortest_tour_length(distances)


def visibility(rng: np.random.Generator) -> Pair:
    """The walls visible from five places."""
    walls = rng.random(SHAPE) < 0.03
    gallery, free = gallery_of(walls, ~walls), np.argwhere(~walls)
    places = free[rng.integers(len(free), size=5), ::-1] + 0.4
    return (
        lambda: gallery.visible_from(places, 50.0),
        lambda: [visibility_reference.visible_walls(walls, ~walls, (x, y), 50.0) for x, y in places.tolist()],
    )


def beams(rng: np.random.Generator) -> Pair:
    """Counts of the beams of a scan of 180 beams per cell."""
    bearings, ranges = np.linspace(-np.pi, np.pi, 180, endpoint=False), rng.uniform(5.0, 30.0, 180)
    ends = np.stack([ranges * np.cos(bearings) + 40.2, ranges * np.sin(bearings) + 30.3], axis=1)
    scan = (np.array([40.2, 30.3]), ends, rng.random(180) < 0.9, 100.0, 1.5, 3.0)
    passed, hit = np.zeros(SHAPE, np.uint16), np.zeros(SHAPE, np.uint16)
    return lambda: pass_beams(passed, hit, *scan), lambda: visibility_reference.passed_and_hit(SHAPE, *scan)


def free(rng: np.random.Generator) -> Pair:
    """Free distances of 20 pairs of wheel speeds among 100 points, against driving in steps of 1 mm."""
    obstacles = rng.uniform(-2.0, 2.0, (100, 2))
    obstacles = obstacles[np.hypot(*obstacles.T) > 0.5]
    speeds = rng.uniform(0.1, 0.6, (20, 2))
    return (
        lambda: free_distances(speeds, obstacles, 0.4, 0.25, 2.0),
        lambda: [
            reference.distance_until_collision(left, right, obstacles, 0.4, 0.25, 2.0)
            for left, right in speeds.tolist()
        ],
    )
