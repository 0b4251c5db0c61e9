"""ir-scan in the simulated infrared room, over six laps, and on the real log of a turning ranger.

Errors are absolute, the start of the robot being known, but where a name says `aligned`: there the path is laid on the true one
first, as `gridslam evaluate` does by default with a map. Seeds 0 to 19 were not used for tuning. The paper's settings are run
on as many drives as the paper measured (5, 1 cm cells), and on all 20 for the laps (3 cm cells).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.method import IrScanLocalizer
from gridslam.run_config import load_run_config
from tests.benchmarks import infrared_stations as real
from tests.benchmarks.harness import Row, say
from tests.benchmarks.infrared_drives import Drive, Scores, drive, localized, mapped
from tests.benchmarks.real_places import data_dir

SEEDS = range(20)
PAPER_RUNS = range(5)
LAPS_CELL = "method.resolution_m=0.03"


def rows() -> Iterator[Row]:
    """Rooms, laps, stations."""
    rides = [drive("ir-room", seed) for seed in SEEDS]
    yield from map_rows("paper", [mapped(rides[seed], settings("paper/ir-scan")) for seed in PAPER_RUNS])
    yield from map_rows("best", [mapped(ride, settings("ir-scan")) for ride in rides])
    yield from lap_rows()
    yield from station_rows()


def settings(name: str, *overrides: str) -> IrScanConfig:
    """The method's section of a config."""
    method = load_run_config(name, overrides).method
    assert isinstance(method, IrScanConfig)
    return method


def map_rows(name: str, scores: list[Scores]) -> Iterator[Row]:
    """Mean over the runs of each run's mean and variance, the largest error of all runs, and completeness."""
    figures = np.array([score.figures for score in scores])
    for seed, (mean, variance, most, complete) in enumerate(figures):
        say(
            f"ir-room {name}, seed {seed}: mean {100 * mean:.2f} cm, variance {1e4 * variance:.2f} cm2, "
            f"max {100 * most:.1f} cm, completeness p95 {100 * complete:.2f} cm"
        )
    mean, variance, most, complete = figures.mean(axis=0).tolist()
    label = f"ir_scan.room.{name}"
    yield Row(f"{label}.accuracy.mean", 100 * mean, "cm")
    yield Row(f"{label}.accuracy.variance", 1e4 * variance, "cm2")
    yield Row(f"{label}.accuracy.max", 100 * float(figures[:, 2].max()), "cm")
    aligned = [score.aligned_accuracy for score in scores]
    yield Row(f"{label}.aligned.accuracy.mean", 100 * float(np.mean([a.mean() for a in aligned])), "cm")
    yield Row(f"{label}.aligned.accuracy.variance", 1e4 * float(np.mean([a.var() for a in aligned])), "cm2")
    yield Row(f"{label}.aligned.accuracy.max", 100 * max(float(a.max()) for a in aligned), "cm")
    yield Row(f"{label}.completeness.p95", 100 * float(figures[:, 3].max()), "cm")
    yield clearance_row(label, scores)


def clearance_row(label: str, scores: list[Scores]) -> Row:
    """The robot's least distance from the walls of its own map; below 0 it would have collided."""
    return Row(
        f"{label}.clearance", 100 * min(score.clearance_m for score in scores), "cm", 0.0, at_least=True
    )


def lap_rows() -> Iterator[Row]:
    """Final position error of six laps: encoders alone, encoders and gyro, the paper's matching, the best settings."""
    alone = ("method.matching={kind: none}",)
    kinds = {
        "encoders": settings("paper/ir-scan", LAPS_CELL, "method.motion.use_gyro=false", *alone),
        "encoders_gyro": settings("paper/ir-scan", LAPS_CELL, *alone),
        "paper": settings("paper/ir-scan", LAPS_CELL),
        "best": settings("ir-scan", LAPS_CELL),
    }
    found: dict[str, list[Scores]] = {kind: [] for kind in kinds}
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
        yield Row(
            f"ir_scan.laps.{kind}.final.mean", 100 * float(np.mean([score.final_m for score in scores])), "cm"
        )
        yield Row(f"ir_scan.laps.{kind}.final.max", 100 * max(score.final_m for score in scores), "cm")
        aligned = float(np.mean([score.aligned_final_m for score in scores]))
        yield Row(f"ir_scan.laps.{kind}.aligned.final.mean", 100 * aligned, "cm")
        if kind in given:
            yield clearance_row(f"ir_scan.laps.{kind}", scores)
            yield Row(f"ir_scan.laps.{kind}.localize.final.mean", 100 * float(np.mean(given[kind])), "cm")
    yield Row("ir_scan.laps.best.process", min(score.process_s for score in found["best"]), "s of CPU")


def on_the_true_map(ride: Drive, config: IrScanConfig) -> float:
    """Final position error (m) of `localize` on the true map, from the true start."""
    start = tuple(ride.truth.poses[0].tolist())
    return localized(ride, config.model_copy(update={"start": start}))


def station_rows() -> Iterator[Row]:
    """Stations of the real log, disturbed by up to ten cells of 5 cm, before and after matching on the map of the six stations;
    and on the map of the five others, where rooms share little more than doors.
    """
    folder = data_dir()
    if folder is None:
        return
    stations = real.read_stations(folder)
    for kind, drawing in (("shift", "pos"), ("search", "surfaces")):
        config, still = real.config_of(kind), real.config_of("none", drawing)
        made = real.map_of(stations.events, still)
        before, after = [], []
        for seed in SEEDS:
            shifts = real.disturbances(seed, len(stations.xy))
            found = real.found_stations(IrScanLocalizer(config, 0, made), real.disturbed(stations, shifts))
            before.append(np.hypot(*shifts.T))
            after.append(real.errors(found, stations.xy))
        say(f"stations {kind}, seed 0, before (cm): {np.round(100 * before[0], 1).tolist()}")
        say(f"stations {kind}, seed 0, after, two sweeps each (cm): {np.round(100 * after[0], 1).tolist()}")
        yield Row(f"ir_scan.stations.{kind}.before.mean", 100 * float(np.mean(before)), "cm")
        yield Row(f"ir_scan.stations.{kind}.after.mean", 100 * float(np.mean(after)), "cm")
        yield Row(f"ir_scan.stations.{kind}.after.max", 100 * float(np.max(after)), "cm")
        yield Row(f"ir_scan.stations.{kind}.left_out.mean", 100 * left_out(stations, config, still), "cm")


def left_out(stations: real.Stations, config: IrScanConfig, still: IrScanConfig) -> float:
    """Mean error (m) of stations that are matched on the map of the five others, over five seeds."""
    errors = []
    for k, xy in enumerate(stations.xy):
        made = real.map_of(real.without(stations, k).events, still)
        alone = real.without(stations, k, keep_only=True)
        for seed in PAPER_RUNS:
            shifts = real.disturbances(seed, len(stations.xy))
            found = real.found_stations(IrScanLocalizer(config, 0, made), real.disturbed(alone, shifts))
            errors.append(np.hypot(*(found - xy).T).mean())
    return float(np.mean(errors))
