"""How time and memory grow with the number of particles, the size of cells, and the size of the map.

Each figure is a ratio of two runs, one after the other: how much more the larger one takes. Runs are commands in processes of
their own, on a log made here by the simulator; what any run takes, however small, is not taken off. So the ratios are those
that a user sees in report.json's `timing` and `memory`.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.maps.map_server import load_map, save_map
from gridslam.maps.occupancy import OccupancyGrid
from tests.benchmarks.bench_slam_sd import command, report_of
from tests.benchmarks.harness import BenchmarkRow, say

ALONE = True

TIMES = 1  # runs of each kind; their median is used
DRIVE_S = 120.0  # part of the log for scaling particles and cells
SEARCH_S = 40.0  # part for growing maps; it contains the first search of the whole map
MAP_PARTICLES = 2500

Report = dict[str, Any]


def rows() -> Iterator[BenchmarkRow]:
    """slam-sd over particles and cells, ispace-mcl over particles and maps."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        log = folder / "office.mcap"
        command("simulate", "office", "-o", str(log), "-q")
        true_map = log.with_suffix(".truth") / "map.yaml"
        drive = part_of(log, DRIVE_S)
        yield from slam_rows(drive)
        yield from localization_rows(drive, true_map)
        yield from map_rows(part_of(log, SEARCH_S), true_map, folder)


def part_of(log: Path, seconds: float) -> Path:
    """The first part of a log."""
    part = log.with_stem(f"start-{seconds:.0f}")
    command("convert", str(log), str(part), "--end", str(seconds), "-q")
    return part


def slam_rows(log: Path) -> Iterator[BenchmarkRow]:
    """The filter without pose graph optimisation, so that the particles dominate."""
    by_particles = {
        n: measured("map", log, "paper/slam-sd", f"method.particles={n}") for n in (15, 30, 60, 120)
    }
    for few, many in ((15, 30), (30, 60), (60, 120)):
        yield ratio("slam_sd.particles", by_particles, few, many, 2.3)
        yield memory_ratio("slam_sd.particles", by_particles, few, many, 1.5)
    by_cell = {cm: measured("map", log, "slam-sd", f"method.map.resolution_m={cm / 100}") for cm in (8, 4, 2)}
    for coarse, fine in ((8, 4), (4, 2)):
        yield ratio("slam_sd.cell_cm", by_cell, coarse, fine, (coarse / fine) ** 2)
        yield memory_ratio("slam_sd.cell_cm", by_cell, coarse, fine, (coarse / fine) ** 2)


def localization_rows(log: Path, true_map: Path) -> Iterator[BenchmarkRow]:
    """A fixed number of particles on the true map."""
    by_particles = {
        n: measured("localize", log, "ispace-mcl", number_of_particles(n), true_map)
        for n in (1250, 2500, 5000, 10000)
    }
    for few, many in ((1250, 2500), (2500, 5000), (5000, 10000)):
        yield ratio("ispace_mcl.particles", by_particles, few, many, 2.3)
        yield memory_ratio("ispace_mcl.particles", by_particles, few, many, 1.3)


def map_rows(log: Path, true_map: Path, folder: Path) -> Iterator[BenchmarkRow]:
    """A fixed number of particles on the true map with unknown around it, and on one of many such buildings side by side.

    Unknown cells cost memory and the time to prepare the map, included here. Many buildings are as much more to search, again and
    again, for nothing distinguishes them: there the time of a search is what counts.
    """
    grid = load_map(true_map)
    padded: dict[int, Report] = {}
    tiled: dict[int, Report] = {}
    for times in (1, 2, 4):
        for kind, runs in (("padded", padded), ("tiled", tiled)):
            larger = save_map(enlarged(grid, times, kind), folder / f"{kind}-{times}")
            override = number_of_particles(MAP_PARTICLES)
            runs[times**2] = measured("localize", log, "ispace-mcl", override, larger)
    for small, large in ((1, 4), (4, 16)):
        yield ratio("ispace_mcl.map_padded", padded, small, large, 2.5, whole_time)
        yield memory_ratio("ispace_mcl.map_padded", padded, small, large, 2.5)
        yield ratio("ispace_mcl.map_tiled", tiled, small, large, 4.0, time_of_a_search)
        yield memory_ratio("ispace_mcl.map_tiled", tiled, small, large, 3.0)


def enlarged(grid: OccupancyGrid, times: int, kind: str) -> OccupancyGrid:
    """The map, `times` as wide and high: `padded` with unknown cells, or `tiled`."""
    rows, cols = grid.probability.shape
    if kind == "tiled":
        return OccupancyGrid(np.tile(grid.probability, (times, times)), grid.geometry)
    larger = np.full((times * rows, times * cols), np.nan, np.float32)
    larger[:rows, :cols] = grid.probability
    return OccupancyGrid(larger, grid.geometry)


def number_of_particles(n: int) -> str:
    """The override for a fixed number of particles."""
    return f"method.particles={{min: {n}, max: {n}}}"


def measured(verb: str, log: Path, config: str, override: str, known_map: Path | None = None) -> Report:
    """The report of the run with the median process time."""
    reports = []
    for k in range(TIMES):
        with tempfile.TemporaryDirectory() as scratch:
            given = ("--map", str(known_map)) if known_map is not None else ()
            out = Path(scratch) / "run"
            options = ("--set", override, "--seed", str(k), "-o", str(out), "-q")
            command(verb, str(log), "-c", config, *given, *options)
            reports.append(report_of(out))
    middle = statistics.median_low([r["timing"]["process_s"] for r in reports])
    report: Report = next(r for r in reports if r["timing"]["process_s"] == middle)
    on = "" if known_map is None else f" on {known_map.stem}"
    say(f"{config} {override}{on}: {middle:.2f} s, {report['memory']['peak_mb']:.0f} MB")
    return report


def process_time(report: Report) -> float:
    """Processing time (s) of the method."""
    return float(report["timing"]["process_s"])


def whole_time(report: Report) -> float:
    """Time (s) from the start to the finished run directory."""
    return float(report["timing"]["total_s"])


def time_of_a_search(report: Report) -> float:
    """Time (s) of one search of the whole map."""
    return float(report["timing"]["method"]["search"] / report["counters"]["searches"])


def ratio(
    name: str,
    runs: Mapping[int, Report],
    smaller: int,
    larger: int,
    bound: float,
    time_of: Callable[[Report], float] = process_time,
) -> BenchmarkRow:
    """Ratio of the times of the larger and the smaller run."""
    times = [time_of(runs[key]) for key in (smaller, larger)]
    return BenchmarkRow(f"scaling.{name}.{smaller}_to_{larger}.time", times[1] / times[0], "x", bound)


def memory_ratio(
    name: str, runs: Mapping[int, Report], smaller: int, larger: int, bound: float
) -> BenchmarkRow:
    """Ratio of the memory of the larger and the smaller run."""
    peaks = [runs[key]["memory"]["peak_mb"] for key in (smaller, larger)]
    return BenchmarkRow(f"scaling.{name}.{smaller}_to_{larger}.memory", peaks[1] / peaks[0], "x", bound)
