"""How time and memory grow with the number of particles, and with the cells of the map (each step four times as many).

Each figure is a ratio of two runs, one after the other: how much more the larger one takes. Runs are commands in
processes of their own, on logs made here by the simulator; process time of the whole command less that of the smallest
possible run is not taken off, so the ratios are those that a user sees in report.json's `timing.process_s`.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.bench_slam_sd import command, report_of
from tests.benchmarks.harness import Row, say

ALONE = True

TIMES = 1  # runs of each kind; the median counts


def rows() -> Iterator[Row]:
    """slam-sd over particles and cells, ispace-mcl over particles and maps."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        log = folder / "office.mcap"
        command("simulate", "office", "-o", str(log), "-q")
        yield from slam_rows(log)
        yield from localization_rows(log)


def slam_rows(log: Path) -> Iterator[Row]:
    """The filter alone, without its final stage, so that the particles are what counts."""
    by_particles = {
        n: measured("map", log, "paper/slam-sd", f"method.particles={n}") for n in (15, 30, 60, 120)
    }
    for few, many in ((15, 30), (30, 60), (60, 120)):
        yield ratio("slam_sd.particles", by_particles, few, many, 2.3)
    by_cell = {cm: measured("map", log, "slam-sd", f"method.map.resolution_m={cm / 100}") for cm in (8, 4, 2)}
    for coarse, fine in ((8, 4), (4, 2)):
        yield ratio("slam_sd.cell_cm", by_cell, coarse, fine, (coarse / fine) ** 2)
        yield memory_ratio("slam_sd.cell_cm", by_cell, coarse, fine, (coarse / fine) ** 2)


def localization_rows(log: Path) -> Iterator[Row]:
    """A fixed number of particles on the true map."""
    by_particles = {
        n: measured("localize", log, "ispace-mcl", f"method.particles={{least: {n}, most: {n}}}")
        for n in (1250, 2500, 5000, 10000)
    }
    for few, many in ((1250, 2500), (2500, 5000), (5000, 10000)):
        yield ratio("ispace_mcl.particles", by_particles, few, many, 2.3)


def measured(verb: str, log: Path, config: str, override: str) -> dict[str, Any]:
    """The report of the run with the median process time."""
    reports = []
    for k in range(TIMES):
        with tempfile.TemporaryDirectory() as scratch:
            given = ("--map", str(log.with_suffix(".truth") / "map.yaml")) if verb == "localize" else ()
            out = Path(scratch) / "run"
            command(
                verb,
                str(log),
                "-c",
                config,
                *given,
                "--set",
                override,
                "--seed",
                str(k),
                "-o",
                str(out),
                "-q",
            )
            reports.append(report_of(out))
    middle = statistics.median_low([r["timing"]["process_s"] for r in reports])
    report = next(r for r in reports if r["timing"]["process_s"] == middle)
    say(f"{config} {override}: {middle:.2f} s, {report['memory']['peak_mb']:.0f} MB")
    return report


def ratio(name: str, runs: dict[int, dict[str, Any]], smaller: int, larger: int, bound: float) -> Row:
    """How many times longer the larger run takes."""
    times = [runs[key]["timing"]["process_s"] for key in (smaller, larger)]
    return Row(f"scaling.{name}.{smaller}_to_{larger}.time", times[1] / times[0], "x", bound)


def memory_ratio(name: str, runs: dict[int, dict[str, Any]], smaller: int, larger: int, bound: float) -> Row:
    """How many times more memory the larger run needs."""
    peaks = [runs[key]["memory"]["peak_mb"] for key in (smaller, larger)]
    return Row(f"scaling.{name}.{smaller}_to_{larger}.memory", peaks[1] / peaks[0], "x", bound)
