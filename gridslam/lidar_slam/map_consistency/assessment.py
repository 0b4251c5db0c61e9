"""The doubt about a finished map, and the places that it comes from.

It is calibrated on maps with a known truth (tests/benchmarks/bench_doubt.py). Errors where no place was seen twice cannot be
found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import cumulative_distance
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.loop_closure.drift import DriftModel
from gridslam.lidar_slam.map_consistency.contradictions import find_contradictions
from gridslam.lidar_slam.map_consistency.doubtful_places import (
    DoubtfulPlace,
    contradicted_places,
    strained_loops,
    strained_places,
)
from gridslam.lidar_slam.map_consistency.observations import observe
from gridslam.lidar_slam.map_consistency.passages import (
    find_passages,
    spaced_scans,
)
from gridslam.lidar_slam.map_consistency.tension import loop_residuals, max_strained
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]

DOUBTFUL = 0.5  # maps with more doubt are warned about
MENTIONED = 0.1  # places with less doubt are not listed
MAX_PLACES = 20
MIN_SCANS = 3


@dataclass(frozen=True, slots=True)
class MapConsistency:
    """The `doubt` about a map, in [0, 1], which is that of its most doubtful place, and how much of the map could be checked.

    `places` are the doubtful places, most doubtful first. `compared_wall_m` is the length of wall seen by more than one passage,
    `contradicted_wall_m` the part of it that another passage looked through. `revisited` is the fraction of the path with other
    passages near it, `longest_unchecked_m` its longest part without any.
    """

    doubt: float
    places: tuple[DoubtfulPlace, ...]
    compared_wall_m: float
    contradicted_wall_m: float
    largest_strain: float
    largest_loop_residual: float
    revisited: float
    longest_unchecked_m: float

    @property
    def is_doubtful(self) -> bool:
        """Whether the map should not be used without a look at it."""
        return self.doubt > DOUBTFUL

    @property
    def summary(self) -> str:
        """One line: the doubt, and where it comes from."""
        if self.places and self.is_doubtful:
            place = self.places[0]
            return (
                f"the map contradicts itself near ({place.x_m:.1f}, {place.y_m:.1f}): {place.reason} "
                f"(doubt {self.doubt:.2f}, {len(self.places)} doubtful places)"
            )
        if not self.compared_wall_m:
            return "doubt unknown: no place was seen twice"
        return (
            f"doubt {self.doubt:.2f}; {100.0 * self.revisited:.0f} % of the path was checked by another passage, "
            f"at most {self.longest_unchecked_m:.0f} m in one piece were not"
        )

    @property
    def measures(self) -> dict[str, object]:
        """The numbers and places, for report.json."""
        return {
            "doubt": round(self.doubt, 4),
            "is_doubtful": self.is_doubtful,
            "summary": self.summary,
            "compared_wall_m": round(self.compared_wall_m, 2),
            "contradicted_wall_m": round(self.contradicted_wall_m, 2),
            "largest_strain": round(self.largest_strain, 3),
            "largest_loop_residual": round(self.largest_loop_residual, 2),
            "revisited": round(self.revisited, 4),
            "longest_unchecked_m": round(self.longest_unchecked_m, 1),
            "places": [
                {
                    "kind": place.kind,
                    "x_m": round(place.x_m, 2),
                    "y_m": round(place.y_m, 2),
                    "reason": place.reason,
                    "size_m": round(place.size_m, 2),
                    "doubt": round(place.doubt, 3),
                }
                for place in self.places
            ],
        }


def assess_map(
    scans: Sequence[PreparedScan],
    poses: Floats,
    track: Floats,
    loops: Edges | None = None,
    drift: DriftModel | None = None,
) -> MapConsistency:
    """Consistency of a map, given its key scans, their final `poses` `(n, 3)` and those of the front end, `track` `(n, 3)`.

    `loops` are the accepted loop closures between the key scans, with the covariance of each match; `drift` is the front end's.
    """
    rows = spaced_scans(cumulative_distance(poses)) if len(poses) else np.zeros(0, np.int64)
    if len(rows) < MIN_SCANS:
        return MapConsistency(
            0.0,
            (),
            compared_wall_m=0.0,
            contradicted_wall_m=0.0,
            largest_strain=0.0,
            largest_loop_residual=0.0,
            revisited=0.0,
            longest_unchecked_m=0.0,
        )
    passages = find_passages(poses[rows], cumulative_distance(poses)[rows])
    observations = observe(scans, rows, poses[rows], passages)
    found = find_contradictions(observations)
    strained = max_strained(track, poses, rows, drift or DriftModel())
    stamps = np.array([scans[row].stamp_ns for row in rows], np.int64)
    places = contradicted_places(found, observations, passages, stamps)
    places += strained_places(strained, poses[rows], stamps)
    residuals = np.zeros(1)
    if loops is not None and len(loops):
        residuals = loop_residuals(poses, loops)
        places += strained_loops(scans, poses, loops, residuals)
    places = sorted(places, key=lambda place: (-place.doubt, place.x_m, place.y_m))
    unchecked = _longest_unchecked_m(passages.travel_m, passages.is_revisited)
    return MapConsistency(
        max((place.doubt for place in places), default=0.0),
        tuple(place for place in places if place.doubt >= MENTIONED)[:MAX_PLACES],
        compared_wall_m=found.compared_wall_m,
        contradicted_wall_m=found.wall_m,
        largest_strain=strained.strain if strained else 0.0,
        largest_loop_residual=float(residuals.max()),
        revisited=float(passages.is_revisited.mean()),
        longest_unchecked_m=unchecked,
    )


def _longest_unchecked_m(travel_m: Floats, is_revisited: NDArray[np.bool_]) -> float:
    """The longest part of the path without another passage near it."""
    checked = np.concatenate([travel_m[:1], travel_m[is_revisited], travel_m[-1:]])
    return float(np.diff(checked).max())
