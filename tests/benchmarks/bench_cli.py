"""Waiting times of the program itself: its help, and writing a large run."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.methods.base import RunResult, Series
from gridslam.report.write import write_run
from gridslam.runs.run import Run
from gridslam.runs.run_config import load_config
from gridslam.runs.run_counts import merge_counts
from tests.benchmarks.harness import BenchmarkRow

ALONE = True


def rows() -> Iterator[BenchmarkRow]:
    """Start-up of `--help`, and a run directory of a 100 m x 100 m map with 10,000 poses."""
    yield BenchmarkRow("cli.help", min(help_s() for _ in range(3)), "s")
    yield BenchmarkRow("report.write", write_s(), "s")


def help_s() -> float:
    """Wall time of `gridslam --help`."""
    started = time.perf_counter()
    command = [sys.executable, "-c", "from gridslam.cli.main import main; main(['--help'])"]
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - started


def write_s() -> float:
    """Wall time of writing, including imports."""
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        write_run(large_run(), Path(folder) / "out")
        return time.perf_counter() - started


def large_run() -> Run:
    """A map of random values, as large as a building."""
    rng = np.random.default_rng(1)
    stamps = np.arange(10_000, dtype=np.int64) * 100_000_000
    poses = np.cumsum(rng.normal(0, 0.05, (10_000, 3)), axis=0)
    grid = OccupancyGrid(rng.random((2000, 2000), np.float32), GridGeometry(0.05, (-50.0, -50.0)))
    series = {name: Series(stamps, rng.random(10_000)) for name in ("particle_std", "n_eff")}
    return Run(
        command="map",
        config=load_config("slam-sd"),
        log_path=Path("large.mcap"),
        inputs={},
        result=RunResult(Trajectory(stamps, poses), grid, series=series),
        occupancy=grid,
        truth=Trajectory(stamps, poses),
        status="complete",
        is_lossy=False,
        problems=(),
        counts=merge_counts({}, {}),
        read_s=0.0,
        process_s=0.0,
    )
