"""Interface of a method to the rest of the program: events in, one result out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event
from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import GridLayer, OccupancyGrid


@dataclass(frozen=True, slots=True)
class Table:
    """Rows under named columns; written as CSV beside the map."""

    columns: Sequence[str]
    rows: Sequence[Sequence[object]]


@dataclass(frozen=True, slots=True)
class PlacedObject:
    """An object in the map: its pose `(3,)` in the map frame, its state in a word (or none), and whether it was moved."""

    name: str
    pose: NDArray[np.float64]
    state: str = ""
    has_moved: bool = False


@dataclass(frozen=True, slots=True)
class Series:
    """A diagnostic over time: stamps int64 `(n,)`, values float64 `(n,)`, and the unit for the plot's axis."""

    stamps_ns: NDArray[np.int64]
    values: NDArray[np.float64]
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture that only the method can make; written as PNG beside the map and shown in the report.

    `rgb` is uint8 `(height, width, 3)`, top row first; `note` says in a sentence what is to be seen.
    """

    rgb: NDArray[np.uint8]
    title: str
    note: str = ""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The estimated pose `(3,)` in the map frame at a stamp; particles `(n, 3)` where the method keeps any."""

    stamp_ns: int
    pose: NDArray[np.float64]
    particles: NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True)
class Doubt:
    """The reason why a finished result is not to be trusted.

    `status` replaces `complete` as the status of the run: `lost` for poses that the method itself does not believe,
    `inconsistent` for results whose parts contradict each other, `apart` for drives that were not found to
    overlap. `reason` is one line for the user that says what was observed and what to check.
    """

    status: Literal["lost", "inconsistent", "apart"]
    reason: str


def no_stamps() -> NDArray[np.int64]:
    """An empty array `(0, 2)` of pairs of stamps."""
    return np.zeros((0, 2), np.int64)


@dataclass(frozen=True, slots=True)
class RunResult:
    """All that a run found. `counters` counts what was used, skipped (`skipped.<stream>.<reason>`) or rejected.

    `occupancy` becomes map.pgm, and each of `maps` NAME.pgm beside it; `pictures` become NAME.png. `loops_ns` `(k, 2)` are the
    stamps of the poses that loop closures join, `untrusted_ns` `(k, 2)` the first and last stamps of parts of the trajectory that
    the method does not believe; `position_std` (m) belongs to the trajectory. These three are drawn in map.png.

    `trajectories` become NAME.tum, and `files` are written as they are, under their names.
    """

    trajectory: Trajectory
    occupancy: OccupancyGrid | None = None
    maps: Mapping[str, OccupancyGrid] = field(default_factory=dict)
    layers: Mapping[str, GridLayer] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    objects: Sequence[PlacedObject] = ()
    series: Mapping[str, Series] = field(default_factory=dict)
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    trajectories: Mapping[str, Trajectory] = field(default_factory=dict)
    files: Mapping[str, bytes] = field(default_factory=dict)
    counters: Mapping[str, int] = field(default_factory=dict)
    timings_s: Mapping[str, float] = field(default_factory=dict)
    measures: Mapping[str, object] = field(default_factory=dict)  # JSON-able facts of its own for report.json
    # Repairs and doubts about the log, one line each, reported like the log's own problems
    notes: Sequence[str] = ()
    loops_ns: NDArray[np.int64] = field(default_factory=no_stamps)
    untrusted_ns: NDArray[np.int64] = field(default_factory=no_stamps)
    position_std: Series | None = None
    doubt: Doubt | None = None  # None: the method has no reason to distrust its result


class Method(Protocol):
    """Processes the events of one log in order; `result` may be asked at any time and then ends the run."""

    @property
    def estimate(self) -> Estimate | None:
        """The present belief, for progress and plots; None before the first pose."""

    def process(self, event: Event) -> None:
        """Take in one event; events of kinds that the method does not use are ignored."""

    def result(self) -> RunResult:
        """Finish (offline stages run here) and hand over what was found."""
