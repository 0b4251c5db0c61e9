"""The rotating infrared ranger of the real logs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gridslam.methods.ir_scan.method import IrScanLocalizer, IrScanMapper
from tests.benchmarks.infrared_stations import (
    Stations,
    config_of,
    disturbances,
    disturbed,
    errors,
    found_stations,
    map_of,
    read_stations,
    without,
)

pytestmark = pytest.mark.real_data


@pytest.fixture(scope="module")
def stations(data_dir: Path) -> Stations:
    return read_stations(data_dir)


def test_six_stations_of_two_sweeps_are_mapped_at_their_measured_positions(stations: Stations) -> None:
    method = IrScanMapper(config_of("none"), 0)
    found = found_stations(method, stations.events)
    assert len(found) == 12
    assert errors(found, stations.xy).max() < 1e-9
    counters = method.result().counters
    assert counters["used.range"] > 2000
    assert counters["skipped.range.stale"] >= 1  # the first reading of station 6
    skipped = sum(n for key, n in counters.items() if key.startswith("skipped.range."))
    assert counters["used.range"] + skipped == 2400


@pytest.mark.parametrize(("kind", "bound_m"), [("shift", 0.05), ("search", 0.03)])
def test_matching_on_the_map_corrects_disturbed_stations(
    stations: Stations, kind: str, bound_m: float
) -> None:
    occupancy = map_of(stations.events, config_of("none", drawing="pos" if kind == "shift" else "surfaces"))
    shifts = disturbances(3, 6)
    found = found_stations(IrScanLocalizer(config_of(kind), 0, occupancy), disturbed(stations, shifts))
    assert np.hypot(*shifts.T).mean() > 0.3
    assert errors(found, stations.xy).max() < bound_m


def test_a_station_outside_the_map_is_refused_rather_than_misplaced(stations: Stations) -> None:
    """Rooms overlap through doors only, so that a station is ambiguous on a map without its own readings."""
    shifts = disturbances(3, 6)
    for k in range(6):
        occupancy = map_of(without(stations, k).events, config_of("none"))
        alone = without(stations, k, keep_only=True)
        found = found_stations(IrScanLocalizer(config_of("search"), 0, occupancy), disturbed(alone, shifts))
        assert np.hypot(*(found - stations.xy[k]).T).max() < np.hypot(*shifts[k]) + 0.05
