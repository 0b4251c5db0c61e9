"""The inputs of an evaluation: the result, the ground truth, and the options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import Align
from gridslam.evaluation.association import DEFAULT_MAX_DIFFERENCE_NS, DEFAULT_MAX_GAP_NS, Sync
from gridslam.evaluation.object_errors import MapObject
from gridslam.evaluation.pose_errors import Delta
from gridslam.evaluation.readers.pose_series import PoseSeries
from gridslam.evaluation.relations import Relations
from gridslam.maps.occupancy import OccupancyGrid


@dataclass(frozen=True, slots=True)
class Result:
    """The result to evaluate; parts that are None are not evaluated.

    `occupancy` is the map as saved, `probability` its layer of unrounded probabilities.
    """

    trajectory: Trajectory | None = None
    occupancy: OccupancyGrid | None = None
    probability: OccupancyGrid | None = None
    objects: Mapping[str, MapObject] | None = None
    series: PoseSeries | None = None  # the trajectory as its file states it, for remarks
    consistency: Mapping[str, float | bool] | None = None  # the run's own measures of its map, by name


@dataclass(frozen=True, slots=True)
class Truth:
    """The ground truth; measures are omitted if their part of it is None."""

    trajectory: Trajectory | None = None
    relations: Relations | None = None
    occupancy: OccupancyGrid | None = None
    objects: Mapping[str, MapObject] | None = None
    series: PoseSeries | None = None  # the trajectory as its file states it, for remarks


@dataclass(frozen=True, slots=True)
class EvaluationOptions:
    """Options of an evaluation: alignment, pairing of poses, length of relative motions, bounds of success."""

    align: Align = "none"
    with_scale: bool = False
    sync: Sync = "nearest"
    max_difference_ns: int | None = None  # None: 10 ms for `nearest`, no bound for `interpolate`
    max_gap_ns: int = DEFAULT_MAX_GAP_NS  # largest gap between the two poses that `interpolate` uses
    time_offset_ns: int = 0  # added to the stamps of the estimate
    delta: Delta = field(default_factory=Delta)
    # True walls that are farther than this from every known cell are not missed; None: all walls count
    completeness_radius_m: float | None = None
    max_position_m: float = 0.5  # largest error of a successful localization and of a correct object
    max_heading_deg: float = 10.0  # largest error of a successful localization

    @property
    def nearness(self) -> str:
        """The condition that the stamps of paired poses meet, as the end of a sentence."""
        if self.sync == "interpolate" and self.max_difference_ns is None:
            return f"between poses of the other at most {self.max_gap_ns / 1e9:g} s apart"
        largest = DEFAULT_MAX_DIFFERENCE_NS if self.max_difference_ns is None else self.max_difference_ns
        return f"within {largest / 1e9:g} s of each other"

    @property
    def nearness_option(self) -> str:
        """The command-line option that sets the bound named in `nearness`."""
        is_gap = self.sync == "interpolate" and self.max_difference_ns is None
        return "--max-gap" if is_gap else "--max-difference"
