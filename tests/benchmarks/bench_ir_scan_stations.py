"""The match of ir-scan on the real log of a rotating ranger with hand-measured stations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.method import IrScanLocalizer
from tests.benchmarks import infrared_stations as real
from tests.benchmarks.harness import BenchmarkRow, say
from tests.benchmarks.real_places import data_dir

SEEDS = range(20)
FEW_SEEDS = range(5)


def rows() -> Iterator[BenchmarkRow]:
    """Errors of stations disturbed by up to ten cells of 5 cm, before and after matching on the map of all six stations.

    `left_out`: on the map of the five other stations, which have little more than doors in common with it.
    """
    folder = data_dir()
    if folder is None:
        return
    stations = real.read_stations(folder)
    for kind, drawing in (("shift", "pos"), ("search", "surfaces")):
        config, unmatched = real.config_of(kind), real.config_of("none", drawing)
        occupancy = real.map_of(stations.events, unmatched)
        before, after = [], []
        for seed in SEEDS:
            shifts = real.disturbances(seed, len(stations.xy))
            found = real.found_stations(
                IrScanLocalizer(config, 0, occupancy), real.disturbed(stations, shifts)
            )
            before.append(np.hypot(*shifts.T))
            after.append(real.errors(found, stations.xy))
        say(f"stations {kind}, seed 0, before (cm): {np.round(100 * before[0], 1).tolist()}")
        say(f"stations {kind}, seed 0, after, two sweeps each (cm): {np.round(100 * after[0], 1).tolist()}")
        yield BenchmarkRow(f"ir_scan.stations.{kind}.before.mean", 100 * float(np.mean(before)), "cm")
        yield BenchmarkRow(f"ir_scan.stations.{kind}.after.mean", 100 * float(np.mean(after)), "cm")
        yield BenchmarkRow(f"ir_scan.stations.{kind}.after.max", 100 * float(np.max(after)), "cm")
        yield BenchmarkRow(
            f"ir_scan.stations.{kind}.left_out.mean", 100 * left_out(stations, config, unmatched), "cm"
        )


def left_out(stations: real.Stations, config: IrScanConfig, unmatched: IrScanConfig) -> float:
    """Mean error (m) of stations matched on the map of the five others, over five seeds."""
    errors = []
    for k, xy in enumerate(stations.xy):
        occupancy = real.map_of(real.without(stations, k).events, unmatched)
        alone = real.without(stations, k, keep_only=True)
        for seed in FEW_SEEDS:
            shifts = real.disturbances(seed, len(stations.xy))
            found = real.found_stations(IrScanLocalizer(config, 0, occupancy), real.disturbed(alone, shifts))
            errors.append(np.hypot(*(found - xy).T).mean())
    return float(np.mean(errors))
