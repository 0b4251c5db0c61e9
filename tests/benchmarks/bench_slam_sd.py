"""slam-sd on the public logs: accuracy on five seeds, with and without the loop closure; time, split by stage; memory.

Each run is the command itself in a process of its own, as a user starts it. The seeds were not used for tuning.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir

ALONE = True

SEEDS = range(5)
CONFIGS = {"pose_graph": "slam-sd", "filter_alone": "paper/slam-sd"}


def rows() -> Iterator[BenchmarkRow]:
    """The worst seed of each figure against its bound; every seed on stderr."""
    folder = data_dir()
    if folder is None:
        return
    lidar = folder / "lidar"
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch)
        for stage, config in CONFIGS.items():
            runs = [
                mapped(lidar / "aces.clf.bz2", config, seed, out / f"aces-{stage}-{seed}") for seed in SEEDS
            ]
            scored = [
                evaluated(run, "--relations", str(lidar / "aces.relations"))["relations"] for run in runs
            ]
            means = [score["trans"]["mean"] for score in scored]
            say(f"aces, {stage}: relations.trans.mean (m) of seeds 0 to 4: {rounded(means)}")
            say(f"aces, {stage}: relations.rot.mean (deg): {rounded([s['rot']['mean'] for s in scored])}")
            yield BenchmarkRow(
                f"slam_sd.aces.{stage}.relations", max(means), "m", 0.0345 if stage == "pose_graph" else 0.055
            )
            yield BenchmarkRow(f"slam_sd.aces.{stage}.missed", max(s["missed"] for s in scored), "of 1279", 0)
            yield from cost(f"slam_sd.aces.{stage}", [report_of(run) for run in runs])
        reference = str(lidar / "mit-csail.reference.txt")
        runs = [mapped(lidar / "mit-csail.clf.bz2", "slam-sd", seed, out / f"mit-{seed}") for seed in SEEDS]
        errors = [
            evaluated(run, "--truth", reference, "--align", "se2")["ape"]["trans"]["rmse"] for run in runs
        ]
        say(f"mit-csail, loop closure: ape.trans.rmse (m) of seeds 0 to 4: {rounded(errors)}")
        yield BenchmarkRow("slam_sd.mit_csail.ape", max(errors), "m", 0.15)


def cost(name: str, reports: list[dict[str, Any]]) -> Iterator[BenchmarkRow]:
    """Time as a multiple of reading the same log in the same run, the seconds on stderr, and the largest memory."""
    timing = [report["timing"] for report in reports]
    say(f"{name}: total s: {rounded([t['total_s'] for t in timing], 1)}")
    for stage in timing[0]["method"]:
        say(f"{name}: {stage} s: {rounded([t['method'][stage] for t in timing], 1)}")
    ratio = statistics.median(t["process_s"] / t["read_s"] for t in timing)
    yield BenchmarkRow(f"{name}.process_per_read", ratio, "x")
    yield BenchmarkRow(f"{name}.memory", max(report["memory"]["peak_mb"] for report in reports), "MB", 400.0)


def mapped(log: Path, config: str, seed: int, folder: Path) -> Path:
    """The run directory of `gridslam map`."""
    command("map", str(log), "-c", config, "--seed", str(seed), "-o", str(folder), "-q")
    return folder


def evaluated(folder: Path, *options: str) -> Any:
    """The document of `gridslam evaluate --json`."""
    return json.loads(command("evaluate", str(folder), *options, "--json"))


def report_of(folder: Path) -> Any:
    """The run's report."""
    return json.loads((folder / "report.json").read_text())


def command(*arguments: str) -> str:
    """What a gridslam command writes to stdout; its failure is the benchmark's."""
    program = [sys.executable, "-c", "from gridslam.cli.main import run; run()", *arguments]
    return subprocess.run(program, check=True, capture_output=True, text=True).stdout


def rounded(values: list[float], digits: int = 4) -> list[float]:
    """For the eye."""
    return [round(value, digits) for value in values]
