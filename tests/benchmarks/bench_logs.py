"""Reading scans (beside the mcap package's own reader), text logs and clouds; the memory of reading a log much larger than it."""

from __future__ import annotations

import bz2
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from gridslam.core.messages import LaserScan, PointCloud, Transform
from gridslam.logs import LogConfig, open_log
from gridslam.logs.mcap.writer import McapWriter
from tests.benchmarks.harness import BenchmarkRow
from tests.benchmarks.real_places import data_dir

ALONE = True

SCANS, BEAMS = 20_000, 360
RUNS = 5  # pairs of runs; of speeds alone the fastest counts: the rest is the machine's
CLOUDS, RINGS, COLUMNS = 40, 64, 1024
READ = """
import sys
from gridslam.logs import open_log
from gridslam.report.environment import peak_memory_mb
for _ in open_log(sys.argv[1]).events():
    pass
print(peak_memory_mb())
"""


def rows() -> Iterator[BenchmarkRow]:
    """Opening and reading scans, by compression; text logs and clouds a second; peak memory with a log of 300 MB."""
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("zstd", "lz4", "none"):
            path = Path(folder) / f"{compression}.mcap"
            write(path, compression, SCANS)
            pairs = [(seconds_of_reading(path), seconds_of_mcap(path)) for _ in range(RUNS)]
            # Each beside the other: the machine's speed is not the same in all pairs.
            ratio = statistics.median(ours / theirs for ours, theirs in pairs)
            yield BenchmarkRow(
                f"logs.mcap.{compression}.scans", SCANS / min(ours for ours, _ in pairs), "1/s"
            )
            yield BenchmarkRow(f"logs.mcap.{compression}.over_mcap", ratio, "x", bound=4.0)
        clouds = Path(folder) / "clouds.mcap"
        write_clouds(clouds)
        yield BenchmarkRow(
            "logs.mcap.clouds", max(clouds_per_s(clouds) for _ in range(RUNS)), "1/s", bound=60, at_least=True
        )
        write(Path(folder) / "large.mcap", "none", 10 * SCANS)
        folder_of_data = data_dir()
        if folder_of_data is not None:
            text = Path(folder) / "killian.clf"
            text.write_bytes(bz2.decompress((folder_of_data / "lidar" / "mit-killian.clf.bz2").read_bytes()))
            yield carmen_row(text)
        size_mb = (Path(folder) / "large.mcap").stat().st_size / 1e6
        yield BenchmarkRow("logs.mcap.large", size_mb, "MB")
        yield BenchmarkRow("logs.mcap.large.memory", peak_mb(Path(folder) / "large.mcap"), "MB", bound=150)


def carmen_row(path: Path) -> BenchmarkRow:
    """Scans of a text log that are read in a second, opening it included."""
    fastest_s, count = np.inf, 0
    for _ in range(RUNS):
        started = time.perf_counter()
        with open_log(path, LogConfig()) as log:
            count = sum(isinstance(event, LaserScan) for event in log.events())
        fastest_s = min(fastest_s, time.perf_counter() - started)
    return BenchmarkRow("logs.carmen.scans", count / fastest_s, "1/s", bound=15_000, at_least=True)


def write(path: Path, compression: str, count: int) -> None:
    """Scans of a room with noise, to the millimetre."""
    random_numbers = np.random.default_rng(0)
    room = 2 + 8 * random_numbers.random(BEAMS)
    with McapWriter(path, compression) as writer:  # type: ignore[arg-type]
        for i in range(count):
            ranges = np.round(room + random_numbers.normal(0, 0.01, BEAMS), 3).astype(np.float32)
            writer.write(LaserScan(10**18 + i * 10**8, "laser", ranges, -3.125, 0.0174, 0.1, 30.0))


def write_clouds(path: Path) -> None:
    """Clouds of a spinning lidar one metre above the ground, with the times of their points."""
    random_numbers = np.random.default_rng(0)
    bearing = np.tile(np.linspace(-np.pi, np.pi, COLUMNS, endpoint=False), RINGS)
    slope = np.tan(np.repeat(np.linspace(-0.3, 0.3, RINGS), COLUMNS))
    times = ((bearing + np.pi) * (0.1 / (2.0 * np.pi))).astype(np.float32)
    with McapWriter(path, "none") as writer:
        level = (1.0, 0.0, 0.0, 0.0)
        writer.write(Transform(10**18, "base_link", "lidar", (0.0, 0.0, 1.0), level, is_static=True))
        for i in range(CLOUDS):
            ranges = random_numbers.uniform(2.0, 20.0, len(bearing))
            points = ranges[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing), slope])
            writer.write(PointCloud(10**18 + i * 10**8, "lidar", points.astype(np.float32), times))


def clouds_per_s(path: Path) -> float:
    """Clouds made into scans by second of CPU time."""
    with open_log(path, LogConfig(base_frame="base_link"), kinds=["scan"]) as log:
        started = time.process_time()
        assert sum(isinstance(event, LaserScan) for event in log.events()) == CLOUDS
        return CLOUDS / (time.process_time() - started)


def seconds_of_reading(path: Path) -> float:
    """Opening the log and going through all of its events; a thread reads ahead, so CPU time would count more."""
    started = time.perf_counter()
    with open_log(path, kinds=["scan"]) as log:
        assert sum(isinstance(event, LaserScan) for event in log.events()) == SCANS
    return time.perf_counter() - started


def seconds_of_mcap(path: Path) -> float:
    """The mcap package's own reader, which gives the messages as bytes."""
    started = time.perf_counter()
    with path.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == SCANS
    return time.perf_counter() - started


def peak_mb(path: Path) -> float:
    """Peak memory of a process that reads the log."""
    done = subprocess.run([sys.executable, "-c", READ, str(path)], check=True, capture_output=True, text=True)
    # Its own word: the system's counts of children know those of other benchmarks, too
    return float(done.stdout)
