"""Time of each stage of a method's update, and memory of a run: the five methods on their sample logs.

Each run is the command itself in a process of its own, with warm kernels: a first run of each method is thrown away. Stages are
those of report.json's `timing.method`, as fractions of `timing.process_s`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.benchmarks.bench_slam_sd import command, report_of
from tests.benchmarks.harness import HERE, BenchmarkRow, say

ALONE = True

ROOT = HERE.parents[1]
LOGS = ROOT / "sample_logs"
# stages that run once, at the end of the log
AT_END = {"loop_closure", "draw_map", "adjust", "draw", "report"}


@dataclass(frozen=True, slots=True)
class StageSample:
    """A command on a sample log.

    An update is what one of the `counted` inputs (a path in the report) costs, called `unit`: all of the processing but the
    stages AT_END. No more than `max_other` percent of the processing may belong to no stage.
    """

    arguments: tuple[str, ...]
    counted: tuple[str, ...]
    unit: str
    max_other: float


SCANS = ("counts", "scan", "used")
TAGS, MAP = LOGS / "slam-sd-tags.truth/tags.yaml", LOGS / "ispace-mcl.truth/map.yaml"
DRAWING = ROOT / "configs/worlds/drawings/corridor.png"

SAMPLES = {
    "slam-sd": StageSample(("map", "slam-sd.mcap", "-c", "slam-sd"), SCANS, "scan", 10.0),
    "slam-sd-tags": StageSample(
        ("map", "slam-sd-tags.mcap", "-c", "slam-sd", "--tags", str(TAGS)), SCANS, "scan", 10.0
    ),
    "handmap-slam": StageSample(
        (
            *("map", "handmap-slam.mcap", "-c", "handmap-slam", "--drawing", str(DRAWING)),
            *("--set", "method.start=[2.7,3.2,0]"),
        ),
        SCANS,
        "scan",
        15.0,
    ),
    "ir-scan": StageSample(("map", "ir-scan.mcap", "-c", "ir-scan"), ("counters", "scans"), "stop", 40.0),
    "ispace-mcl": StageSample(
        ("localize", "ispace-mcl.mcap", "-c", "ispace-mcl", "--map", str(MAP)), SCANS, "scan", 25.0
    ),
    "stereo-bayes": StageSample(
        ("map", "stereo-bayes.mcap", "-c", "stereo-bayes"), ("counts", "stereo", "used"), "picture", 25.0
    ),
}


def rows() -> Iterator[BenchmarkRow]:
    """For every method: its stages, the remaining time, the time of an update, and the memory."""
    for method, sample in SAMPLES.items():
        run_of(sample)
        yield from rows_of(method, sample, run_of(sample))


def run_of(sample: StageSample) -> Any:
    """The report of one run."""
    verb, log, *options = sample.arguments
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "run"
        command(verb, str(LOGS / log), *options, "-o", str(out), "-q")
        return report_of(out)


def rows_of(method: str, sample: StageSample, report: Any) -> Iterator[BenchmarkRow]:
    """The rows of one run."""
    whole_s, stages = report["timing"]["process_s"], report["timing"]["method"]
    for stage, seconds in stages.items():
        yield BenchmarkRow(f"stages.{method}.{stage}", 100.0 * seconds / whole_s, "%")
    other_s = whole_s - sum(stages.values())
    yield BenchmarkRow(f"stages.{method}.other", 100.0 * other_s / whole_s, "%", sample.max_other)
    count = report
    for key in sample.counted:
        count = count[key]
    at_end = sorted(AT_END & set(stages))
    update_s = whole_s - sum(stages[stage] for stage in at_end)
    without = f", without {', '.join(at_end)}" if at_end else ""
    say(f"{method}: {whole_s:.2f} s; an update is what a {sample.unit} costs, of {count}{without}")
    yield BenchmarkRow(f"stages.{method}.update", 1e3 * update_s / count, f"ms a {sample.unit}")
    yield BenchmarkRow(f"stages.{method}.peak", report["memory"]["peak_mb"], "MB")
