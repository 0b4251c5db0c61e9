"""ir-scan in the simulated infrared room, and over six laps.

Errors are absolute, because the start of the robot is known. For `aligned` errors the path is first aligned with the true one, as
by `gridslam evaluate` with a map. Seeds 0 to 19 were not used for tuning. The paper's settings are run on as many drives as the
paper measured (5, 1 cm cells), and on all 20 for the laps (3 cm cells).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.runs.run_config import load_config
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.infrared_drives import DriveScores, InfraredDrive, drive, localized, mapped

SEEDS = range(20)
PAPER_RUNS = range(5)
LAPS_CELL = "method.resolution_m=0.03"


def rows() -> Iterator[BenchmarkRow]:
    """Rooms and laps."""
    rides = [drive("ir-room", seed) for seed in SEEDS]
    yield from map_rows("paper", [mapped(rides[seed], settings("paper/ir-scan")) for seed in PAPER_RUNS])
    yield from map_rows("best", [mapped(ride, settings("ir-scan")) for ride in rides])
    yield from lap_rows()


def settings(name: str, *overrides: str) -> IrScanConfig:
    """The method's section of a config."""
    method = load_config(name, overrides).method
    assert isinstance(method, IrScanConfig)
    return method


def map_rows(name: str, scores: list[DriveScores]) -> Iterator[BenchmarkRow]:
    """Means over the runs of mean and variance, the largest error of all runs, and completeness."""
    figures = np.array([score.figures for score in scores])
    for seed, (mean, variance, maximum, complete) in enumerate(figures):
        say(
            f"ir-room {name}, seed {seed}: mean {100 * mean:.2f} cm, variance {1e4 * variance:.2f} cm2, "
            f"max {100 * maximum:.1f} cm, completeness p95 {100 * complete:.2f} cm"
        )
    mean, variance, _, complete = figures.mean(axis=0).tolist()
    label = f"ir_scan.room.{name}"
    yield BenchmarkRow(f"{label}.accuracy.mean", 100 * mean, "cm")
    yield BenchmarkRow(f"{label}.accuracy.variance", 1e4 * variance, "cm2")
    yield BenchmarkRow(f"{label}.accuracy.max", 100 * float(figures[:, 2].max()), "cm")
    aligned = [score.aligned_accuracy for score in scores]
    yield BenchmarkRow(
        f"{label}.aligned.accuracy.mean", 100 * float(np.mean([a.mean() for a in aligned])), "cm"
    )
    yield BenchmarkRow(
        f"{label}.aligned.accuracy.variance", 1e4 * float(np.mean([a.var() for a in aligned])), "cm2"
    )
    yield BenchmarkRow(f"{label}.aligned.accuracy.max", 100 * max(float(a.max()) for a in aligned), "cm")
    yield BenchmarkRow(f"{label}.completeness.p95", 100 * float(figures[:, 3].max()), "cm")
    yield clearance_row(label, scores)


def clearance_row(label: str, scores: list[DriveScores]) -> BenchmarkRow:
    """The smallest distance of the robot from the walls of its own map; below 0 it would have collided."""
    return BenchmarkRow(
        f"{label}.clearance", 100 * min(score.clearance_m for score in scores), "cm", 0.0, at_least=True
    )


def lap_rows() -> Iterator[BenchmarkRow]:
    """Final position error of six laps: encoders alone, encoders and gyro, the paper's matching, the best settings."""
    alone = ("method.matching={kind: none}",)
    kinds = {
        "encoders": settings("paper/ir-scan", LAPS_CELL, "method.motion.use_gyro=false", *alone),
        "encoders_gyro": settings("paper/ir-scan", LAPS_CELL, *alone),
        "paper": settings("paper/ir-scan", LAPS_CELL),
        "best": settings("ir-scan", LAPS_CELL),
    }
    found: dict[str, list[DriveScores]] = {kind: [] for kind in kinds}
    given: dict[str, list[float]] = {"paper": [], "best": []}
    for seed in SEEDS:
        ride = drive("ir-laps", seed)
        for kind, config in kinds.items():
            found[kind].append(mapped(ride, config))
        for kind, errors in given.items():
            errors.append(on_the_true_map(ride, kinds[kind]))
        finals = {kind: round(100 * scores[-1].final_m, 2) for kind, scores in found.items()}
        say(f"ir-laps, seed {seed}: final error (cm) {finals}")
    for kind, scores in found.items():
        yield BenchmarkRow(
            f"ir_scan.laps.{kind}.final.mean", 100 * float(np.mean([score.final_m for score in scores])), "cm"
        )
        yield BenchmarkRow(
            f"ir_scan.laps.{kind}.final.max", 100 * max(score.final_m for score in scores), "cm"
        )
        aligned = float(np.mean([score.aligned_final_m for score in scores]))
        yield BenchmarkRow(f"ir_scan.laps.{kind}.aligned.final.mean", 100 * aligned, "cm")
        if kind in given:
            yield clearance_row(f"ir_scan.laps.{kind}", scores)
            yield BenchmarkRow(
                f"ir_scan.laps.{kind}.localize.final.mean", 100 * float(np.mean(given[kind])), "cm"
            )
    best, paper = (min(score.process_s for score in found[kind]) for kind in ("best", "paper"))
    yield BenchmarkRow("ir_scan.laps.best.process", best, "s of CPU")
    yield BenchmarkRow("ir_scan.laps.best.process_per_paper", best / paper, "x")


def on_the_true_map(ride: InfraredDrive, config: IrScanConfig) -> float:
    """Final position error (m) of `localize` on the true map, from the true start."""
    start = tuple(ride.truth.poses[0].tolist())
    return localized(ride, config.model_copy(update={"start": start}))
