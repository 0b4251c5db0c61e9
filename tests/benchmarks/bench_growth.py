"""How slam-sd's time and memory grow with the travel in one kind of place.

Up to 2 km; GRIDSLAM_GROWTH_KM=4 in the environment goes on to 4 km.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

from tests.benchmarks.bench_places import simulated
from tests.benchmarks.bench_slam_sd import command, report_of
from tests.benchmarks.harness import BenchmarkRow, say

ALONE = True

TRAVELS_KM = [km for km in (0.5, 1.0, 2.0, 4.0) if km <= float(os.environ.get("GRIDSLAM_GROWTH_KM", "2"))]
ROUNDS = 3  # of all travels in turn; of each travel the fastest run counts: the rest is the machine's


def rows() -> Iterator[BenchmarkRow]:
    """Ratios of the times of two runs of which one has twice the travel."""
    with tempfile.TemporaryDirectory() as scratch:
        yield from growth(Path(scratch))


def growth(folder: Path) -> Iterator[BenchmarkRow]:
    """Time and memory over the travel in one place."""
    logs = {km: simulated("office", 100, 1000.0 * km, folder) for km in TRAVELS_KM}
    reports: dict[float, list[Any]] = {km: [] for km in TRAVELS_KM}
    for _ in range(ROUNDS):
        for km, log in logs.items():
            out = folder / f"growth-{km:g}"
            command("map", str(log), "-c", "slam-sd", "-o", str(out), "-q", "--force")
            reports[km].append(report_of(out))
    seconds = {km: min(report["timing"]["process_s"] for report in reports[km]) for km in TRAVELS_KM}
    for km in TRAVELS_KM:
        peak = max(report["memory"]["peak_mb"] for report in reports[km])
        say(f"office, {km:g} km: {seconds[km]:.1f} s, {peak:.0f} MB")
    for less, more in pairwise(TRAVELS_KM):
        yield BenchmarkRow(f"growth.{less:g}_to_{more:g}_km.time", seconds[more] / seconds[less], "x", 2.2)
