"""slam-sd on a public log whose odometry is wrong in scale, late, mirrored or gone: the errors, and the faults named."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gridslam.core.messages import Odometry
from gridslam.logs import open_log
from gridslam.logs.write import open_writer
from tests.benchmarks.bench_killian import errors_of
from tests.benchmarks.bench_slam_sd import mapped, report_of
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir

NS_PER_S = 10**9
SCALE_TOLERANCE, LAG_TOLERANCE_S = 0.05, 0.05  # of what a run says


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault of odometry: the words with which a run must name it, distances as a fraction of the true ones, delay (s)."""

    change: Callable[[Odometry], Odometry | None]
    named: str = ""
    scale: float = 1.0
    lag_s: float = 0.0

    def is_named(self, notes: list[str], check: Mapping[str, Any]) -> bool:
        """Whether the run says what is wrong, and by about how much; of good odometry, nothing."""
        if not self.named:
            return not notes
        is_right = abs(check["distance_scale"] / self.scale - 1.0) <= SCALE_TOLERANCE
        is_right = is_right and abs(check["lag_s"] - self.lag_s) <= LAG_TOLERANCE_S
        return is_right and any(self.named in note for note in notes)


def scaled(factor: float) -> Callable[[Odometry], Odometry]:
    """Distances times a factor."""
    return lambda odometry: replace(odometry, x_m=factor * odometry.x_m, y_m=factor * odometry.y_m)


def late(seconds: float) -> Callable[[Odometry], Odometry]:
    """Stamps late by a time (s)."""
    return lambda odometry: replace(odometry, stamp_ns=odometry.stamp_ns + round(seconds * NS_PER_S))


FAULTS = {
    "scaled_0.8": Fault(scaled(0.8), "its distances are", scale=0.8),
    "scaled_1.25": Fault(scaled(1.25), "its distances are", scale=1.25),
    "late_0.15": Fault(late(0.15), "s late", lag_s=0.15),
    "late_0.3": Fault(late(0.3), "s late", lag_s=0.3),
    "yaw_mirrored": Fault(lambda o: replace(o, yaw_rad=-o.yaw_rad), "its yaw has the wrong sign"),
    "wheels_exchanged": Fault(
        lambda o: replace(o, y_m=-o.y_m, yaw_rad=-o.yaw_rad), "its yaw and y have the wrong sign"
    ),
    "dropped": Fault(lambda o: None),
    "none": Fault(lambda o: o),
}


def rows() -> Iterator[BenchmarkRow]:
    """Relations of each faulty log, and the faults that the runs did not name."""
    folder = data_dir()
    if folder is None:
        return
    lidar = folder / "lidar"
    unnamed = 0
    with tempfile.TemporaryDirectory() as scratch:
        for name, fault in FAULTS.items():
            log = with_fault(lidar / "aces.clf.bz2", fault, Path(scratch) / f"{name}.mcap")
            run = mapped(log, "slam-sd", 0, Path(scratch) / name)
            yield BenchmarkRow(f"odometry.aces.{name}", errors_of(run, lidar / "aces.relations")["mean"], "m")
            report = report_of(run)
            notes = [note for note in report["log"]["problems"] if "contradicts" in note]
            check = report["measures"]["motion"]["odometry_check"]
            say(f"aces, odometry {name}: {notes} {check}")
            unnamed += not fault.is_named(notes, check)
    yield BenchmarkRow("odometry.aces.unnamed", unnamed, f"of {len(FAULTS)}")


def with_fault(log: Path, fault: Fault, output: Path) -> Path:
    """The log with a fault in all of its odometry."""
    with open_log(log) as source, open_writer(output, False) as writer:
        for event in source.events():
            changed = fault.change(event) if isinstance(event, Odometry) else event
            if changed is not None:
                writer.write(changed)
    return output
