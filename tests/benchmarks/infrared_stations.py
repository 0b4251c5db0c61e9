"""The real log of a rotating infrared ranger at six hand-measured stations, disturbed and corrected by matching.

The stations are absolute poses in the layout of docs/ir-scan.md. A disturbed station is off by up to ten cells of 5 cm along each
axis.
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
MAX_SHIFT_CELLS = 10
MEASURED_M = 0.01  # standard deviation of a hand-measured station
DISTURBED_M = MAX_SHIFT_CELLS * CELL_M / np.sqrt(3.0)  # standard deviation of a uniform disturbance
YAW_STD_RAD = 0.01
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
            "constants": {
                "yaw": 0,
                "var_x": MEASURED_M**2,
                "var_y": MEASURED_M**2,
                "var_yaw": YAW_STD_RAD**2,
            },
            "row_stamps": {"period_s": 0.01},
        },
    ]
}
READINGS = {"neighbour_m": 0.3, "noise_m": 0.02, "noise_per_m2": 0.002, "bearing_rad": 0.016}


@dataclass(frozen=True, slots=True)
class Stations:
    """The events of the log, and the positions of the stations `(6, 2)`."""

    events: list[Event]
    xy: Floats


def read_stations(folder: Path) -> Stations:
    """The log in data/infrared."""
    config = LogConfig.model_validate({"csv": LAYOUT, "extrinsics": {"tf_luna": {"yaw": np.pi / 2}}})
    with open_log(folder / "infrared", config, ("range", "pose")) as log:
        events = list(log.events())
    positions = np.array([event.pose[:2] for event in events if isinstance(event, AbsolutePose)])
    first = np.r_[True, (np.diff(positions, axis=0) != 0.0).any(axis=1)]
    return Stations(events, positions[first])


def config_of(matching: Literal["none", "shift", "search"], drawing: str = "surfaces") -> IrScanConfig:
    """Settings for a ranger of 8 m with steps of 1.8 degrees and known heading; stations are not adjusted."""
    advanced: dict[str, dict[str, object]] = {
        "none": {},
        # A disturbed station is not evidence against a larger shift: only equal sums tie.
        "shift": {"tie_sigmas": 0.0},
        "search": {"rotation_rad": 0.03, "max_position_std_m": 0.1},
    }
    return IrScanConfig.model_validate(
        {
            "resolution_m": CELL_M,
            "readings": READINGS,
            "matching": {"kind": matching, "window_cells": MAX_SHIFT_CELLS},
            "adjustment": {"enabled": False},
            "drawing": {"kind": drawing},
            "advanced": {"matching": advanced[matching]},
        }
    )


def disturbances(seed: int, count: int) -> Floats:
    """Shifts `(count, 2)` (m), uniform up to ten cells along each axis."""
    max_shift = MAX_SHIFT_CELLS * CELL_M
    return np.random.default_rng(seed).uniform(-max_shift, max_shift, (count, 2))


def disturbed(stations: Stations, shifts: Floats, known: frozenset[int] = frozenset()) -> list[Event]:
    """The events with every station shifted and uncertain; `known` stations keep their positions."""
    events: list[Event] = []
    for event in stations.events:
        if isinstance(event, AbsolutePose):
            k = station_of(stations, event)
            if k not in known:
                pose = event.pose + np.append(shifts[k], 0.0)
                covariance = np.diag([DISTURBED_M**2, DISTURBED_M**2, YAW_STD_RAD**2])
                event = replace(
                    event, pose=readonly(pose, np.float64), covariance=readonly(covariance, np.float64)
                )
        events.append(event)
    return events


def without(stations: Stations, left_out: int, keep_only: bool = False) -> Stations:
    """The log without one station, or with that station alone."""
    kept, current = [], -1
    for event in stations.events:
        if isinstance(event, AbsolutePose):
            current = station_of(stations, event)
        if current < 0 or (current == left_out) == keep_only:
            kept.append(event)
    return Stations(kept, stations.xy)


def station_of(stations: Stations, measured: AbsolutePose) -> int:
    """Index of the station of an absolute pose."""
    return int(np.argmin(np.hypot(*(stations.xy - measured.pose[:2]).T)))


def map_of(events: list[Event], config: IrScanConfig) -> OccupancyGrid:
    """The map of a run."""
    mapper = IrScanMapper(config, 0)
    for event in events:
        mapper.process(event)
    occupancy = mapper.result().occupancy
    assert occupancy is not None
    return occupancy


def found_stations(method: IrScanMapper | IrScanLocalizer, events: list[Event]) -> Floats:
    """Estimated positions of the stops `(stops, 2)`."""
    for event in events:
        method.process(event)
    rows = method.result().tables["stops"].rows
    return np.array([row[1:3] for row in rows], dtype=np.float64)


def errors(found: Floats, xy: Floats) -> Floats:
    """Distance of each stop from its station; a station has several stops, in order."""
    return np.hypot(*(found - np.repeat(xy, len(found) // len(xy), axis=0)).T)
