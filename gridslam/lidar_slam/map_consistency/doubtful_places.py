"""The doubtful places of a map: what is wrong there, by how much, and how doubtful that makes the map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.graph.pose_graph import Edges
from gridslam.graph.pose_graph import residuals as residual_poses
from gridslam.lidar_slam.map_consistency.contradictions import Contradiction, Contradictions
from gridslam.lidar_slam.map_consistency.displacement import Displacement, find_displacement
from gridslam.lidar_slam.map_consistency.observations import Observations
from gridslam.lidar_slam.map_consistency.passages import Passages
from gridslam.lidar_slam.map_consistency.tension import StrainedPath
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]

Kind = Literal["contradiction", "strain", "loop"]

REASONS: dict[Kind, str] = {
    "contradiction": "one of two passages is displaced by about {:.1f} m",
    "strain": "the path departs by {:.1f} m from what scan matching measured",
    "loop": "a loop closure is missed by {:.2f} m",
}
# Metres of contradicted wall times the gain of a displacement at which the doubt is 0.5
EVEN_EVIDENCE_M = 1.2
MIN_WALL_M = 1.0  # smaller contradictions are not looked into
AGREEING_WITHIN_M = 40.0  # largest distance of two contradictions that one passage can have caused
AGREEING_M = 0.6  # largest difference of their displacements: one and a half steps of the search
MAX_CONTRADICTIONS = 12  # the largest ones are looked into
EVEN_STRAIN = 3.0  # standard deviations of the front end's drift at which the doubt is 0.5
EVEN_RESIDUAL = 8.0  # normalised residual of an accepted loop at which the doubt is 0.5
STEEPNESS = 3.0  # steepness of the logistic curve over the logarithm


@dataclass(frozen=True, slots=True)
class DoubtfulPlace:
    """A place of the map (m), what is wrong there, by how much (m), its doubt, and two scans that show it."""

    kind: Kind
    x_m: float
    y_m: float
    size_m: float
    doubt: float
    stamps_ns: tuple[int, int]

    @property
    def reason(self) -> str:
        """The fault, in words."""
        return REASONS[self.kind].format(self.size_m)


def doubt_of(value: float, even: float) -> float:
    """A logistic curve over the logarithm of a positive value: 0.5 at `even`."""
    return 1.0 / (1.0 + (even / value) ** STEEPNESS) if value > 0.0 else 0.0


def contradicted_places(
    found: Contradictions, observations: Observations, passages: Passages, stamps: NDArray[np.int64]
) -> list[DoubtfulPlace]:
    """Places where scans contradict mapped walls, each with its doubt, given the `stamps` `(n,)` (ns) of the scans."""
    large = [place for place in found.places[:MAX_CONTRADICTIONS] if place.wall_m >= MIN_WALL_M]
    moved = [find_displacement(place, observations, passages) for place in large]
    evidence = agreeing_evidence(large, moved)
    return [
        DoubtfulPlace(
            "contradiction",
            place.x_m,
            y_m=place.y_m,
            size_m=float(np.hypot(by.dx_m, by.dy_m)),
            doubt=doubt_of(metres, EVEN_EVIDENCE_M),
            stamps_ns=(int(stamps[by.seen_by]), int(stamps[by.looked_through_by])),
        )
        for place, by, metres in zip(large, moved, evidence, strict=True)
    ]


def agreeing_evidence(places: Sequence[Contradiction], moved: Sequence[Displacement]) -> list[float]:
    """For each place, metres of contradicted wall times the gain of its displacement, with those of others nearby that agree.

    Places agree where the same displacement, or its opposite, explains them: it is then that of a whole passage.
    """
    own = [place.wall_m * max(by.gain, 0.0) for place, by in zip(places, moved, strict=True)]
    evidence = []
    for place, by in zip(places, moved, strict=True):
        is_alike = [
            math.hypot(place.x_m - other.x_m, place.y_m - other.y_m) <= AGREEING_WITHIN_M
            and min(math.hypot(by.dx_m - s * o.dx_m, by.dy_m - s * o.dy_m) for s in (-1.0, 1.0)) <= AGREEING_M
            for other, o in zip(places, moved, strict=True)
        ]
        evidence.append(sum(metres for metres, same in zip(own, is_alike, strict=True) if same))
    return evidence


def strained_places(
    strained: StrainedPath | None, poses: Floats, stamps: NDArray[np.int64]
) -> list[DoubtfulPlace]:
    """The middle of the most strained part of the path, if any, given the scans' poses `(n, 3)` and stamps `(n,)` (ns)."""
    if strained is None:
        return []
    x, y = poses[strained.middle, :2].tolist()
    doubt = doubt_of(strained.strain, EVEN_STRAIN)
    pair = int(stamps[strained.start]), int(stamps[strained.end])
    size = strained.departure_m
    return [DoubtfulPlace("strain", x, y_m=y, size_m=size, doubt=doubt, stamps_ns=pair)]


def strained_loops(
    scans: Sequence[PreparedScan], poses: Floats, loops: Edges, residuals: Floats
) -> list[DoubtfulPlace]:
    """The loop that is met worst, given the scans' poses `(n, 3)` and the normalised residuals `(m,)` of the loops."""
    worst = int(np.argmax(residuals))
    source, target = int(loops.source[worst]), int(loops.target[worst])
    x, y = poses[target, :2].tolist()
    error = residual_poses(poses, loops)[worst]
    doubt = doubt_of(float(residuals[worst]), EVEN_RESIDUAL)
    stamps = scans[source].stamp_ns, scans[target].stamp_ns
    return [
        DoubtfulPlace(
            "loop", x, y_m=y, size_m=float(np.hypot(error[0], error[1])), doubt=doubt, stamps_ns=stamps
        )
    ]
