"""Paths of lines and arcs between 200 random pairs of poses on each of the public maps, 50 on the large one, or
GRIDSLAM_PLAN_PAIRS of them.

Robot: a disc of 0.2 m, arcs of 0.2 m or more, forwards only. A refused pair counts as failed unless all random
drives from the pose that the refusal names end at an obstacle within 1.5 m. The length is compared with a lower bound of the
any-angle shortest path: the path over 8 neighbours, half a cell's diagonal closer to obstacles, divided by 1.0824.
"""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import MethodError
from gridslam.kernels.planning.grid import cost_to_go
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.occupancy_correlation import fit_correlation
from gridslam.planning.arcs_and_lines import plan_path
from gridslam.planning.footprint import disc
from gridslam.planning.options import PlanOptions
from gridslam.planning.space import Space, make_space
from gridslam.report.plan import SEGMENT_COLUMNS, segment_row
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir
from tests.reference.path_checks import Squares, drive, escapes, largest_jump

# Pairs of poses; tb3_sandbox is the same place
MAPS = {
    "depot": 200,
    "warehouse": 50,
    "turtlebot3_world": 200,
}
ROBOT_M, RADIUS_M, MARGIN_M = 0.2, 0.2, 0.005
KEPT_M = ROBOT_M + MARGIN_M
OPPOSITE_HEADING = np.array([0.0, 0.0, np.pi])
OCTILE = 1.0824  # largest ratio of the path over 8 neighbours to the straight line

Floats = NDArray[np.float64]


@dataclass
class PlanCounts:
    """Counts and figures over the pairs of one map."""

    found: int = 0
    refused: int = 0
    failed: int = 0
    collisions: int = 0
    invalid: int = 0
    ratios: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)


def rows() -> Iterator[BenchmarkRow]:
    """Per map: pairs found, refused and failed, collisions, breaks, ratio of lengths, CPU time; and r0."""
    folder = data_dir()
    if folder is None:
        return
    logging.getLogger("gridslam").setLevel(logging.ERROR)
    for name, few in MAPS.items():
        pairs = int(os.environ.get("GRIDSLAM_PLAN_PAIRS", few))
        grid = load_any_map(folder / "maps" / f"{name}.yaml")
        tally = measure(grid, name, pairs, reverse=False)
        yield BenchmarkRow(f"plan.{name}.found", tally.found, f"of {pairs}")
        yield BenchmarkRow(f"plan.{name}.refused", tally.refused, "headings that cannot be met")
        yield BenchmarkRow(f"plan.{name}.failed", tally.failed, f"of {pairs}", 0)
        yield BenchmarkRow(f"plan.{name}.collisions", tally.collisions, "paths", 0)
        yield BenchmarkRow(f"plan.{name}.broken", tally.invalid, "paths", 0)
        yield BenchmarkRow(
            f"plan.{name}.length_ratio", float(np.median(tally.ratios)), "of the any-angle length", 1.3
        )
        yield BenchmarkRow(f"plan.{name}.cpu.median", float(np.median(tally.seconds)), "s")
        yield BenchmarkRow(f"plan.{name}.cpu.max", float(np.max(tally.seconds)), "s")
        backwards = measure(grid, name, pairs // 4, reverse=True)
        yield BenchmarkRow(
            f"plan.{name}.reverse.failed", backwards.failed + backwards.refused, f"of {pairs // 4}", 0
        )
        yield BenchmarkRow(
            f"plan.{name}.reverse.collisions", backwards.collisions + backwards.invalid, "paths", 0
        )
        yield BenchmarkRow(f"correlation.{name}.r0", fit_correlation(grid).r0, "per cell")


def measure(grid: OccupancyGrid, name: str, pairs: int, reverse: bool) -> PlanCounts:
    """Plan between random poses of one component of the free space, and check the paths."""
    squares, space = Squares(grid), robot_space(grid)
    options = PlanOptions(discs=disc(ROBOT_M), min_radius_m=RADIUS_M, margin_m=MARGIN_M, reverse=reverse)
    tally = PlanCounts()
    for i, (start, goal) in enumerate(random_pairs(grid, squares, pairs)):
        started = time.process_time()
        try:
            plan = plan_path(grid, start, goal, options)
        except MethodError as error:
            tally.seconds.append(time.process_time() - started)
            text = str(error)
            end = start if text.startswith("start") else goal + OPPOSITE_HEADING
            if "heading" in text and not reverse and not escapes(squares, end, RADIUS_M, KEPT_M, i):
                tally.refused += 1
            else:
                tally.failed += 1
                say(f"{name} pair {i}, {start.tolist()} to {goal.tolist()}: {text}")
            continue
        tally.seconds.append(time.process_time() - started)
        tally.found += 1
        segments = [dict(zip(SEGMENT_COLUMNS, segment_row(s), strict=True)) for s in plan.path.segments]
        poses = np.vstack([drive(segment) for segment in segments])
        tally.collisions += bool(squares.distances(poses[:, :2], 0.25).min() < ROBOT_M - 1e-4)
        tally.invalid += not is_valid(segments, poses, start, goal)
        tally.ratios.append(plan.path.length_m / shortest(space, start, goal))
    return tally


def is_valid(segments: list[dict[str, float]], poses: Floats, start: Floats, goal: Floats) -> bool:
    """Whether the path meets both ends with continuous heading and bounded curvature."""
    gap, yaw_jump = largest_jump(segments)
    ends = np.abs(poses[[0, -1], :2] - [start[:2], goal[:2]]).max()
    yaws = np.abs(np.angle(np.exp(1j * (poses[[0, -1], 2] - [start[2], goal[2]])))).max()
    curvature = max(abs(s["angle_rad"]) / max(abs(s["length_m"]), 1e-12) for s in segments)
    return bool(max(gap, ends) < 1e-4 and max(yaw_jump, yaws) < 1e-4 and curvature <= 1.0 / RADIUS_M + 1e-6)


def random_pairs(grid: OccupancyGrid, squares: Squares, count: int) -> Iterator[tuple[Floats, Floats]]:
    """Pairs of poses with random headings in one 4-connected component of cells where the robot fits."""
    rng = np.random.default_rng(0)
    space = robot_space(grid)
    is_wide_enough = space.field[1::2, 1::2] >= ROBOT_M + MARGIN_M
    _, labels = cv2.connectedComponents(is_wide_enough.astype(np.uint8), connectivity=4)
    cells = np.argwhere(is_wide_enough)
    resolution_m = grid.geometry.resolution_m
    while count:
        pair = cells[rng.integers(len(cells), size=2)]
        inside = rng.uniform(0.0, 1.0, (2, 2))
        yaws = rng.uniform(-np.pi, np.pi, 2)
        points = (pair[:, ::-1] - 1 + inside) * resolution_m + grid.geometry.origin_xy_m
        clear = squares.distances(points, 0.25).min() >= KEPT_M
        if clear and labels[tuple(pair[0])] == labels[tuple(pair[1])]:
            count -= 1
            yield np.array([*points[0], yaws[0]]), np.array([*points[1], yaws[1]])


def robot_space(grid: OccupancyGrid) -> Space:
    """The space of the robot on a map."""
    return make_space(grid, disc(ROBOT_M), MARGIN_M, 0.9, True)


def shortest(space: Space, start: Floats, goal: Floats) -> float:
    """A lower bound (m) of the length of any path that keeps the robot's radius from obstacles."""
    cells = [space.cell(pose) for pose in space.to_local(np.array([start, goal]))]
    cols = space.blocked.shape[1]
    flat = [row * cols + col for row, col in cells]
    required = ROBOT_M - 0.7072 * space.resolution_m
    cost = cost_to_go(
        field=space.field,
        resolution=space.resolution_m,
        required=required,
        obstacle_weight=0.0,
        inflation_radius=1.0,
        goal=flat[1],
        start=flat[0],
        search_factor=1.0,
    )
    distance = float(cost[cells[0]])
    straight = float(np.hypot(*(start - goal)[:2]))
    return max(straight, distance / OCTILE - 2.0 * space.resolution_m, 0.05)
