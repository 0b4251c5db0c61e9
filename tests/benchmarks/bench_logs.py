"""Reading scans: messages a second on one core, and the memory of reading a log much larger than it."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gridslam.core.messages import LaserScan
from gridslam.logs import open_log
from gridslam.logs.mcap.writer import McapWriter
from tests.benchmarks.harness import Row

ALONE = True

SCANS, BEAMS = 20_000, 360
READ = """
import sys
from gridslam.logs import open_log
from gridslam.report.environment import peak_memory_mb
for _ in open_log(sys.argv[1]).events():
    pass
print(peak_memory_mb())
"""


def rows() -> Iterator[Row]:
    """Scans a second of opening and reading, by compression; peak memory with a log of 300 MB."""
    with tempfile.TemporaryDirectory() as folder:
        for compression in ("zstd", "lz4", "none"):
            path = Path(folder) / f"{compression}.mcap"
            write(path, compression, SCANS)
            rate = max(SCANS / seconds_of_reading(path) for _ in range(3))
            yield Row(f"logs.mcap.{compression}.scans", rate, "1/s", bound=40_000, at_least=True)
        write(Path(folder) / "large.mcap", "none", 10 * SCANS)
        size_mb = (Path(folder) / "large.mcap").stat().st_size / 1e6
        yield Row("logs.mcap.large", size_mb, "MB")
        yield Row("logs.mcap.large.memory", peak_mb(Path(folder) / "large.mcap"), "MB", bound=150)


def write(path: Path, compression: str, count: int) -> None:
    """Scans of a room with noise, to the millimetre."""
    random_numbers = np.random.default_rng(0)
    room = 2 + 8 * random_numbers.random(BEAMS)
    with McapWriter(path, compression) as writer:  # type: ignore[arg-type]
        for i in range(count):
            ranges = np.round(room + random_numbers.normal(0, 0.01, BEAMS), 3).astype(np.float32)
            writer.write(LaserScan(10**18 + i * 10**8, "laser", ranges, -3.125, 0.0174, 0.1, 30.0))


def seconds_of_reading(path: Path) -> float:
    """Opening the log and going through all of its events."""
    started = time.perf_counter()
    with open_log(path, kinds=["scan"]) as log:
        assert sum(isinstance(event, LaserScan) for event in log.events()) == SCANS
    return time.perf_counter() - started


def peak_mb(path: Path) -> float:
    """Peak memory of a process that reads the log."""
    done = subprocess.run([sys.executable, "-c", READ, str(path)], check=True, capture_output=True, text=True)
    return float(
        done.stdout
    )  # its own word: the system's counts of children know those of other benchmarks, too
