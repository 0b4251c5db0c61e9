"""The real log of a turning infrared ranger at six hand-measured stations: disturb the stations, and match them back.

The stations are delivered as fixes, through the layout that docs/ir-scan.md shows. A disturbed station is off by up to ten cells
of 5 cm along each axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import AbsolutePose, Event, readonly
from gridslam.logs.config import LogConfig
from gridslam.logs.open import open_log
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.method import IrScanLocalizer, IrScanMapper

Floats = NDArray[np.float64]

CELL_M = 0.05
MOST_CELLS = 10
MEASURED_M = 0.01  # deviation of a station measured by hand
DISTURBED_M = MOST_CELLS * CELL_M / np.sqrt(3.0)  # of a uniform disturbance
TURN_RAD = 0.01
LAYOUT = {
    "streams": [
        {
            "kind": "range",
            "file": "scans.csv",
            "columns": {"bearing": "bearing_deg", "range": "range_cm"},
            "constants": {"sensor": "tf_luna", "range_min": 20, "range_max": 800},
            "units": {"bearing": "deg_clockwise", "range": "cm", "range_min": "cm", "range_max": "cm"},
            "invalid": [0],
            "invalid_from": 22873,
            "row_stamps": {"period_s": 0.01},
        },
        {
            "kind": "pose",
            "file": "scans.csv",
            "columns": {"x": "station_x_cm", "y": "station_y_cm"},
            "units": {"x": "cm", "y": "cm"},
            "constants": {"yaw": 0, "var_x": MEASURED_M**2, "var_y": MEASURED_M**2, "var_yaw": TURN_RAD**2},
            "row_stamps": {"period_s": 0.01},
        },
    ]
}
READINGS = {"neighbour_m": 0.3, "noise_m": 0.02, "noise_per_m2": 0.002, "bearing_rad": 0.016}


@dataclass(frozen=True, slots=True)
class Stations:
    """The log's events, and where the stations are `(6, 2)`."""

    events: list[Event]
    xy: Floats


def read_stations(folder: Path) -> Stations:
    """The log in data/infrared."""
    config = LogConfig.model_validate({"csv": LAYOUT, "extrinsics": {"tf_luna": {"yaw": np.pi / 2}}})
    with open_log(folder / "infrared", config, ("range", "pose")) as log:
        events = list(log.events())
    fixes = np.array([event.pose[:2] for event in events if isinstance(event, AbsolutePose)])
    first = np.r_[True, (np.diff(fixes, axis=0) != 0.0).any(axis=1)]
    return Stations(events, fixes[first])


def config_of(matching: Literal["none", "shift", "search"], drawing: str = "surfaces") -> IrScanConfig:
    """Settings for a ranger of 8 m, 1.8 degrees a step, whose heading is known; stations are not adjusted."""
    kinds: dict[str, dict[str, object]] = {
        "none": {"kind": "none"},
        # What a station is told to be says nothing against a larger shift: only equal sums tie.
        "shift": {"kind": "shift", "window_cells": MOST_CELLS, "tie_sigmas": 0.0},
        "search": {"kind": "search", "window_cells": MOST_CELLS, "rotation_rad": 0.03, "ambiguous_m": 0.1},
    }
    return IrScanConfig.model_validate(
        {
            "resolution_m": CELL_M,
            "readings": READINGS,
            "matching": kinds[matching],
            "adjustment": {"enabled": False},
            "drawing": {"kind": drawing},
        }
    )


def disturbances(seed: int, count: int) -> Floats:
    """Shifts `(count, 2)`, uniform up to ten cells each way."""
    reach = MOST_CELLS * CELL_M
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 2))


def disturbed(stations: Stations, shifts: Floats, known: frozenset[int] = frozenset()) -> list[Event]:
    """The events with every station told `shifts` off, and told to be uncertain; `known` stations stay as they are."""
    events: list[Event] = []
    for event in stations.events:
        if isinstance(event, AbsolutePose):
            k = station_of(stations, event)
            if k not in known:
                pose = event.pose + np.append(shifts[k], 0.0)
                covariance = np.diag([DISTURBED_M**2, DISTURBED_M**2, TURN_RAD**2])
                event = replace(
                    event, pose=readonly(pose, np.float64), covariance=readonly(covariance, np.float64)
                )
        events.append(event)
    return events


def without(stations: Stations, left_out: int, keep_only: bool = False) -> Stations:
    """The log without one station; or that station alone."""
    kept, here = [], -1
    for event in stations.events:
        if isinstance(event, AbsolutePose):
            here = station_of(stations, event)
        if here < 0 or (here == left_out) == keep_only:
            kept.append(event)
    return Stations(kept, stations.xy)


def station_of(stations: Stations, fix: AbsolutePose) -> int:
    """Which station a fix tells of."""
    return int(np.argmin(np.hypot(*(stations.xy - fix.pose[:2]).T)))


def map_of(events: list[Event], config: IrScanConfig) -> OccupancyGrid:
    """The map of a run."""
    mapper = IrScanMapper(config, 0)
    for event in events:
        mapper.process(event)
    made = mapper.result().occupancy
    assert made is not None
    return made


def found_stations(method: IrScanMapper | IrScanLocalizer, events: list[Event]) -> Floats:
    """Where the stops were found, `(stops, 2)`."""
    for event in events:
        method.process(event)
    rows = method.result().tables["stops"].rows
    return np.array([row[1:3] for row in rows], dtype=np.float64)


def errors(found: Floats, xy: Floats) -> Floats:
    """Distance of each stop from its station; a station has several stops, in order."""
    return np.hypot(*(found - np.repeat(xy, len(found) // len(xy), axis=0)).T)
