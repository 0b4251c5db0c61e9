"""Interface between a method and the rest of the program: events in, one result out."""

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
    """An object in the map: its pose `(3,)` in the map frame, its state in one word ("" for none), and whether it was moved."""

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

    `rgb` is uint8 `(height, width, 3)`, top row first; `note` is a sentence that explains the picture.
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
    """The reason why a finished result should not be trusted.

    `status` replaces `complete` as the status of the run: `lost` if the method does not trust its poses, `inconsistent` if parts
    of the result contradict each other, `apart` if no overlap was found between drives. `reason` is one line for the user that
    says what was observed and what to check.
    """

    status: Literal["lost", "inconsistent", "apart"]
    reason: str


def no_stamps() -> NDArray[np.int64]:
    """An empty array `(0, 2)` of pairs of stamps."""
    return np.zeros((0, 2), np.int64)


@dataclass(frozen=True, slots=True)
class RunResult:
    """The result of a run.

    `occupancy` is written as map.pgm, each of `maps` as NAME.pgm, of `pictures` as NAME.png, of `trajectories` as NAME.tum;
    `files` are written unchanged under their names. `counters` counts what was used, skipped (`skipped.<stream>.<reason>`) or
    rejected.

    These are drawn in map.png: `loops_ns` `(k, 2)`, the stamps of the two poses that each loop closure joins; `untrusted_ns`
    `(k, 2)`, the first and last stamp of each part of the trajectory that the method does not trust; `position_std`, the standard
    deviation (m) of positions on the trajectory.
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
    measures: Mapping[str, object] = field(default_factory=dict)  # the method's own entries for report.json
    # Repairs and doubts about the log, one line each, listed with the log's own problems
    notes: Sequence[str] = ()
    loops_ns: NDArray[np.int64] = field(default_factory=no_stamps)
    untrusted_ns: NDArray[np.int64] = field(default_factory=no_stamps)
    position_std: Series | None = None
    doubt: Doubt | None = None


class Method(Protocol):
    """Processes the events of one log in order; `result` may be called at any time and ends the run."""

    @property
    def estimate(self) -> Estimate | None:
        """The current estimate, for progress and plots; None before the first pose."""

    def process(self, event: Event) -> None:
        """Process one event; events of kinds that the method does not use are ignored."""

    def result(self) -> RunResult:
        """Run the offline stages and return the result."""
