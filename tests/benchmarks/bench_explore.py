"""Exploring: points and tour against the optimum, the time of a cycle, and closed loops of a few seeds.

Tables over many seeds come from `python -m tests.benchmarks.explorations OUT`.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.shortest_tour import exact_tour, improved_tour
from gridslam.maps.drawings.drawing import drawn_map, load_drawing
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.pathfinder import CostGrid, find_path, observed_costs
from gridslam.methods.handmap_slam.driving.plan_grid import plan_grid
from gridslam.methods.handmap_slam.driving.pursuit import Pursuit
from gridslam.methods.handmap_slam.scan_memory import BeamEndpoints, ScanMemory
from gridslam.planning.art_gallery import gallery_of, greedy_cover, scatter
from gridslam.planning.dwa import DifferentialDrive, WheelSpeeds
from gridslam.planning.tour import tour_length
from tests.benchmarks.explorations import BUILDING_START, DRAWINGS, ExplorationResult, run_set, trials
from tests.benchmarks.harness import BenchmarkRow
from tests.reference.planning import minimum_cover

Floats = NDArray[np.float64]

DRIVE = DifferentialDrive(
    radius_m=0.25, base_m=0.4, acceleration_mps2=0.8, max_speed_mps=1.5, max_yaw_rate_radps=10.0
)
SEEDS = range(10)


def rows() -> Iterator[BenchmarkRow]:
    """All figures."""
    yield from cover_rows()
    yield from tour_rows()
    yield from cycle_rows()
    yield from loop_rows()
    yield from correction_rows()


def cover_rows() -> Iterator[BenchmarkRow]:
    """Size of the greedy cover over the minimum, on the two built-in drawings, 80 candidates, seeds 0 to 9."""
    for name in ("corridor", "building"):
        drawn = drawn_map(load_drawing(DRAWINGS / f"{name}.png"))
        gallery = gallery_of(drawn.walls, drawn.free)
        ratios, bounds = [], []
        for seed in SEEDS:
            visible = gallery.visible_from(scatter(drawn.free, 80, np.random.default_rng(seed)), 60.0)
            ratios.append(len(greedy_cover(visible)) / minimum_cover(visible))
            bounds.append(np.log(int(visible.any(axis=0).sum())))
        yield BenchmarkRow(f"explore.cover.{name}.over_optimum", float(np.mean(ratios)), "x")
        yield BenchmarkRow(f"explore.cover.{name}.worst", max(ratios), "x", bound=float(min(bounds)))


def tour_rows() -> Iterator[BenchmarkRow]:
    """Length of the local search over the optimum, which the program uses up to 13 places; seeds 0 to 9."""
    ratios = []
    for seed in SEEDS:
        points = np.random.default_rng(seed).uniform(0.0, 10.0, (13, 2))
        table = np.asarray(np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1)))
        best = tour_length(table, np.asarray(exact_tour(table)))
        ratios.append(tour_length(table, np.asarray(improved_tour(table, np.arange(13)))) / best)
    yield BenchmarkRow("explore.tour.local_search.over_optimum", float(np.mean(ratios)), "x")
    yield BenchmarkRow("explore.tour.local_search.worst", max(ratios), "x", bound=1.25)


def cycle_rows() -> Iterator[BenchmarkRow]:
    """CPU time of a command (DWA over 121 pairs of speeds, three scans of 360 beams) and of a new path in the building."""
    scan = _scan_about()
    pursuit = Pursuit(ExplorationConfig(), DRIVE)
    for _ in range(3):
        pursuit.add_scan(np.zeros(3), scan)
    pursuit.follow(np.column_stack([np.linspace(0.0, 3.0, 60), np.zeros(60)]), np.zeros(3))
    stamps = iter(range(10**9, 10**12, 10**8))
    yield BenchmarkRow(
        "explore.command",
        cpu_ms(lambda: pursuit.command(next(stamps), np.zeros(3), WheelSpeeds(0.3, 0.3)), 100),
        "ms",
        bound=5.0,
    )
    drawn = drawn_map(load_drawing(DRAWINGS / "building.png"))
    config, memory = ExplorationConfig(), ScanMemory()
    for k in range(60):
        memory.add(np.array([0.4 * k - 12.0, 0.0, 0.0]), scan)
    pose = DrawingPose(0, *BUILDING_START, scale_x=1.0, scale_y=1.0, position_std=0.1, inlier_ratio=1.0)

    def plan() -> None:
        grid = plan_grid(drawn, 1.0, 1.0)
        blocked, cleared = memory.cells_on(grid, np.zeros(3), pose)
        cell_cost = observed_costs(grid, blocked, cleared, 0.25, config)
        find_path(CostGrid(grid, cell_cost, blocked), pose, np.array([24.0, 24.0]), 0.25, 0.2)

    yield BenchmarkRow("explore.path", cpu_ms(plan, 10), "ms")


def loop_rows() -> Iterator[BenchmarkRow]:
    """Whole explorations, seeds 0 and 1: finished, without contact, with an accurate and complete map."""
    for name in ("corridor-35-corrected", "building-distorted", "curved"):
        found = runs_of(name)
        finished = float(np.mean([run.ended == "finished" for run in found]))
        yield BenchmarkRow(f"explore.{name}.finished", finished, "fraction", bound=1.0, at_least=True)
        yield BenchmarkRow(
            f"explore.{name}.map_error", max(run.map_error_m for run in found), "m", bound=0.05
        )
        yield BenchmarkRow(
            f"explore.{name}.coverage", min(run.coverage for run in found), "fraction", 0.95, at_least=True
        )
        yield BenchmarkRow(
            f"explore.{name}.clearance", min(run.clearance_m for run in found), "m", bound=0.0, at_least=True
        )
        yield BenchmarkRow(f"explore.{name}.cpu", max(run.cpu_s for run in found), "s", bound=60.0)


def correction_rows() -> Iterator[BenchmarkRow]:
    """The paper's form in a corridor 1.4 times as long as drawn, lidar of 8 m, seeds 0 and 1: mean distance between the maps."""
    distances = {}
    for how in ("corrected", "uncorrected"):
        runs = runs_of(f"corridor-35-paper-8m-{how}")
        distances[how] = float(np.mean([run.mean_distance_m for run in runs]))
        yield BenchmarkRow(f"explore.paper.corridor-35.{how}", distances[how], "m")
    gain = distances["uncorrected"] / distances["corrected"]
    yield BenchmarkRow("explore.paper.corridor-35.gain", gain, "x", bound=3.0, at_least=True)


def runs_of(name: str) -> list[ExplorationResult]:
    """Seeds 0 and 1 of a trial."""
    trial = next(t for some in trials().values() for t in some if t.name == name)
    with tempfile.TemporaryDirectory() as folder:
        return run_set([trial], Path(folder), max_seeds=2)


def cpu_ms(call: Callable[[], object], times: int) -> float:
    """Mean CPU time of a call after a first one."""
    call()
    started = time.process_time()
    for _ in range(times):
        call()
    return 1e3 * (time.process_time() - started) / times


def _scan_about() -> BeamEndpoints:
    """360 beams in a corridor 2.4 m wide."""
    bearings = np.linspace(-np.pi, np.pi, 360, endpoint=False)
    ranges = np.minimum(1.2 / np.maximum(np.abs(np.sin(bearings)), 1e-3), 8.0)
    endpoints: Floats = np.column_stack([np.cos(bearings), np.sin(bearings)]) * ranges[:, None]
    return BeamEndpoints(0, np.zeros(2), endpoints, ranges < 8.0)
