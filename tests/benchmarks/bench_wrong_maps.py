"""Localization on a wrong map: of another place, mirrored, negated, of a wrong resolution, or without the part that was driven.

Ten pairs of a log and a map (GRIDSLAM_WRONG_MAPS=50 in the environment: 50; some of them by
`python -m tests.benchmarks.bench_wrong_maps FIRST END`); the run says so if its status is not `complete`. A
mirrored map of a place that is its own mirror image is the right map, which is printed and not counted. Places made by seed, and
the recorded logs and maps where they are.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from itertools import islice

from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.map_registration import register_maps
from gridslam.logs import open_log
from gridslam.maps.load import load_any_map
from gridslam.maps.occupancy import OccupancyGrid
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.localization_drives import (
    LocalizationDrive,
    corridor_drive,
    cropped,
    localized,
    mirrored,
    negated,
    place_drive,
    rescaled,
    wall_points,
)
from tests.benchmarks.real_places import data_dir

PAIRS = int(os.environ.get("GRIDSLAM_WRONG_MAPS", "10"))
SEEDS = (200, 202, 203, 205, 206, 209)
TRAVEL_M = 20.0
ASYMMETRY_M = 0.1  # walls of a mirror image farther than this from a wall distinguish it from the original
MIN_ASYMMETRIC = 0.01  # fraction of such walls below which nothing distinguishes them
MAPS = ("depot", "warehouse", "tb3_sandbox", "turtlebot3_world")


def rows() -> Iterator[BenchmarkRow]:
    """Pairs that are said to be wrong, and right pairs that are doubted."""
    right = drives()
    doubted = [drive.name for drive in right if localized(drive, drive.grid, 0).doubt is not None]
    statuses = [judged(*pair) for pair in islice(pairs(right), PAIRS)]
    said = sum(status != "complete" for status in statuses)
    say(f"right maps that are doubted: {', '.join(doubted) or 'none'} (of {len(right)})")
    yield BenchmarkRow("wrong_maps.said", said / len(statuses), f"of {len(statuses)}")
    yield BenchmarkRow("wrong_maps.false_alarms", len(doubted), f"of {len(right)}")


def judged(name: str, drive: LocalizationDrive, grid: OccupancyGrid) -> str:
    """The status of a localization on a wrong map."""
    result = localized(drive, grid, 0)
    status = "complete" if result.doubt is None else result.doubt.status
    say(f"{drive.name} on {name}: {status}{'  <- missed' if status == 'complete' else ''}")
    return status


def drives() -> list[LocalizationDrive]:
    """Drives with their right maps."""
    found = [place_drive(seed, TRAVEL_M) for seed in SEEDS]
    folder = data_dir()
    if folder is not None:
        floor = load_any_map(folder / "ros2" / "mac_1st_floor_final.yaml")
        with open_log(folder / "ros2" / "macfirst_floor_take_2_0.db3") as log:
            found.append(
                LocalizationDrive("a recorded corridor", tuple(log.events()), Trajectory.empty(), floor)
            )
    return found


def pairs(right: list[LocalizationDrive]) -> Iterator[tuple[str, LocalizationDrive, OccupancyGrid]]:
    """Names, drives and wrong maps."""
    for drive in [*right, corridor_drive(7)]:
        asymmetric = asymmetry(drive.grid)
        if asymmetric < MIN_ASYMMETRIC:
            say(f"{drive.name} mirrored: not counted, its walls are those of its mirror image")
        else:
            yield "its mirrored map", drive, mirrored(drive.grid)
    for drive in right:
        yield "its negated map", drive, negated(drive.grid)
        yield "its map of 1.2 times the size", drive, rescaled(drive.grid, 1.2)
        yield "its map of 0.8 times the size", drive, rescaled(drive.grid, 0.8)
        if len(drive.truth) and (part := cropped(drive, 1.0)) is not None:
            yield "the rest of its map", drive, part
    others: list[tuple[str, OccupancyGrid]] = [(f"the map of {drive.name}", drive.grid) for drive in right]
    folder = data_dir()
    if folder is not None:
        others += [(f"the map {name}", load_any_map(folder / "maps" / f"{name}.yaml")) for name in MAPS]
    for shift in range(1, len(others)):
        for number, drive in enumerate(right):
            name, grid = others[(number + shift) % len(others)]
            if grid is not drive.grid:
                yield name, drive, grid


def asymmetry(grid: OccupancyGrid) -> float:
    """The fraction of the walls of the mirrored map, laid over the map, that are not at its walls."""
    image = mirrored(grid)
    walls = se2.transform_points(register_maps(image, grid).T_truth_map, wall_points(image))
    distances = cKDTree(wall_points(grid)).query(walls)[0]
    return float((distances > ASYMMETRY_M).mean())


if __name__ == "__main__":
    for chosen in islice(pairs(drives()), int(sys.argv[1]), int(sys.argv[2])):
        judged(*chosen)
