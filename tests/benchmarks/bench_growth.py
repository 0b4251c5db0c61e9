"""How slam-sd's time and memory grow with the travel in one kind of place.

Up to 2 km; GRIDSLAM_GROWTH_KM=4 in the environment goes on to 4 km.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from tests.benchmarks.bench_places import simulated
from tests.benchmarks.bench_slam_sd import command, report_of
from tests.benchmarks.harness import Row, say

ALONE = True

TRAVELS_KM = [km for km in (0.5, 1.0, 2.0, 4.0) if km <= float(os.environ.get("GRIDSLAM_GROWTH_KM", "2"))]
RUNS = 2  # of which the faster counts: the rest is the machine's


def rows() -> Iterator[Row]:
    """Ratios of the times of two runs of which one has twice the travel."""
    with tempfile.TemporaryDirectory() as scratch:
        yield from growth(Path(scratch))


def growth(folder: Path) -> Iterator[Row]:
    """Time and memory over the travel in one place."""
    reports = {}
    for km in TRAVELS_KM:
        log = simulated("office", 100, 1000.0 * km, folder)
        out = folder / f"growth-{km:g}"
        runs = []
        for _ in range(RUNS):
            command("map", str(log), "-c", "slam-sd", "-o", str(out), "-q", "--force")
            runs.append(report_of(out))
        reports[km] = min(runs, key=lambda report: report["timing"]["process_s"])
        seconds, peak = reports[km]["timing"]["process_s"], reports[km]["memory"]["peak_mb"]
        say(f"office, {km:g} km: {seconds:.1f} s, {peak:.0f} MB")
    for less, more in pairwise(TRAVELS_KM):
        times = [reports[km]["timing"]["process_s"] for km in (less, more)]
        yield Row(f"growth.{less:g}_to_{more:g}_km.time", times[1] / times[0], "x", 2.2)
