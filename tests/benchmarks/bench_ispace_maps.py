"""Global localization with the lidar alone in simulated drives through places whose maps others made: depot, warehouse, ...

Ten starts each (GRIDSLAM_ISPACE_STARTS=50 in the environment: 50), anywhere in the free space of the map with any heading; the
route has straight legs to random visible positions. The localizer has the map as it was made, with the unknown around it, and
no start pose.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.runs.run import run_localize
from gridslam.runs.run_config import load_config
from gridslam.simulation.record import record_world
from gridslam.simulation.world_config import WorldConfig
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.ispace_trials import LocalizationTrial, interval, judged
from tests.benchmarks.real_places import data_dir
from tests.conftest import REPOSITORY

Floats = NDArray[np.float64]

STARTS = int(os.environ.get("GRIDSLAM_ISPACE_STARTS", "10"))
CLEAR_M = 0.35  # between the robot's centre and anything
SIDE_M = 0.25
FOLDER = REPOSITORY / "out" / "benchmarks" / "ispace-maps"
# Maximum range of the lidar and length of the drive: turtlebot3_world is an arena of 5 m, and its robot's lidar has 3.5 m.
PLACES: Mapping[str, tuple[float, float]] = {
    "depot": (12.0, 25.0),
    "warehouse": (12.0, 25.0),
    "turtlebot3_world": (3.5, 15.0),
}


def rows() -> Iterator[BenchmarkRow]:
    """Successes of all starts with their interval, and the median time to convergence, for every map."""
    folder = data_dir()
    if folder is None:
        return
    for name in PLACES:
        trials = [trial(folder, name, number) for number in range(STARTS)]
        found = sum(t.found for t in trials)
        low, high = interval(found, STARTS)
        failed = [number for number, t in enumerate(trials) if not t.found]
        say(
            f"{name}: {found} of {STARTS} ({100 * low:.0f} to {100 * high:.0f} %), failed: {failed or 'none'}"
        )
        yield BenchmarkRow(f"ispace.maps.{name}.found", 100.0 * found / STARTS, "%")
        times = [t.converged_s for t in trials if t.found]
        yield BenchmarkRow(f"ispace.maps.{name}.converged", float(np.median(times or [np.nan])), "s")


def trial(folder: Path, name: str, number: int) -> LocalizationTrial:
    """One drive through a place, localized with the drive's number as seed."""
    map_path = folder / "maps" / f"{name}.yaml"
    log = log_of(map_path, number)
    run = run_localize(
        load_config("ispace-mcl", [], number), log, map_path, lambda progress: None, lambda: False
    )
    return judged(run, log)


def log_of(map_path: Path, number: int) -> Path:
    """The log of a drive, made when it is not there yet; its truth lies beside it."""
    name = map_path.stem
    log = FOLDER / f"{name}-{number}.mcap"
    if not (log.exists() and log.with_suffix(".truth").is_dir()):
        FOLDER.mkdir(parents=True, exist_ok=True)
        world = world_of(map_path, load_any_map(map_path), *PLACES[name], number)
        record_world(world, map_path.parent, log, force=True)
    return log


def world_of(
    map_path: Path, grid: OccupancyGrid, max_range_m: float, length_m: float, number: int
) -> WorldConfig:
    """The place with a start and a route that the number determines."""
    rng = np.random.default_rng([number, len(map_path.stem)])
    route = route_through(grid, length_m, rng)
    return WorldConfig.model_validate(
        {
            "version": 1,
            "seed": number,
            "plan": {"file": map_path.name},
            "robot": {
                "start": [*route[0].tolist(), float(rng.uniform(-180.0, 180.0))],
                "route": route[1:].tolist(),
                "radius_m": 0.2,
                "arrival_m": 0.15,
                "wheels": {"error_deviation": 0.005, "slip_deviation": 0.03, "turn_slip": 0.02},
            },
            "sensors": {
                "lidar": {"rate_hz": 5, "beams": 240, "range_max_m": max_range_m, "extrinsics": {"x": 0.05}},
                "odometry": {"rate_hz": 20},
            },
        }
    )


def route_through(grid: OccupancyGrid, length_m: float, rng: np.random.Generator) -> Floats:
    """Waypoints `(n, 2)` of a random walk in the largest connected free space, each visible from the one before."""
    resolution = grid.geometry.resolution_m
    # Grey 205, 0.196, is unknown to those who save maps
    free = np.nan_to_num(grid.probability, nan=1.0) < 0.15
    clearance = scipy.ndimage.distance_transform_edt(free) * resolution
    labels, _ = scipy.ndimage.label(clearance > CLEAR_M)
    largest = int(np.argmax(np.bincount(labels.ravel())[1:])) + 1
    cells = np.argwhere(labels == largest)
    route, driven = [cells[rng.integers(len(cells))]], 0.0
    while driven < length_m:
        goal = cells[rng.integers(len(cells))]
        leg = float(np.hypot(*(goal - route[-1]))) * resolution
        if leg > 1.0 and is_clear(clearance, route[-1], goal):
            route.append(goal)
            driven += leg
    return grid.geometry.centres(np.array(route))


def is_clear(clearance: Floats, start: NDArray[np.int64], goal: NDArray[np.int64]) -> bool:
    """Whether the straight line between two cells keeps the side clearance."""
    fractions = np.linspace(0.0, 1.0, int(np.abs(goal - start).max()) + 1)
    rows, cols = np.rint(start + fractions[:, None] * (goal - start)).astype(np.int64).T
    return bool((clearance[rows, cols] > SIDE_M).all())
