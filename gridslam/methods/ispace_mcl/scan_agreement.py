"""Agreement of the beams of a scan with the map at a pose, and of the scans of the last metres together.

People and new things end beams early, so a beam that ends in free space says little about the place. A beam that passes a wall
contradicts the map: on another place's map, or at a wrong pose, some wall of the map stands in the way before long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.visibility import VisibilityField

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

WALL_TOLERANCE_M = 0.25  # a beam that ends nearer to a wall agrees with the map
BLOCKED_TOLERANCE_M = 0.4  # unless a wall lies farther than this before its endpoint
GRAZING_SLACK_M = 0.3  # a beam whose endpoint becomes visible when moved aside by this much grazes a wall
# A beam that ends farther than this behind a wall, and at no other, shows the wall elsewhere
DISPLACED_M = 0.1
BEHIND_WALL_WEIGHT = 0.5  # weight of a beam that ends at a wall behind another one: furniture was moved
OPEN_SPACE_WEIGHT = 0.4  # weight of a beam that ends in free space: a person
ON_WALL_M = 0.05  # a beam that ends as near to a wall, or within a cell of it, ends on the wall

MEMORY_M = 4.0  # travel after which a scan counts 1 / e in the ratios of the last metres
STANDING_WEIGHT_M = 0.02  # smallest weight of a scan in them, as travel
MOVED_M = 1.0  # an estimate that is farther than this from where the odometry leads it is of another place
# Consistent are scans over this travel, ...
MIN_TRAVEL_M = 2.0
# ... of which few beams pass walls. The mean over the right poses was at most 0.016 on 21 of 22 drives, most of them in crowds
# and changed places, and 0.039 or more on 10 of 12 maps of other places. On maps that have aged more beams do: there the
# comparison with other places has to explain them.
MAX_PASSING_RATIO = 0.025
# Of the beams at walls: 0.6 and more at the right poses of 21 of these drives, less than half on 8 of the maps of other places
MIN_ON_WALL_RATIO = 0.5
MIN_AT_WALL_RATIO = 0.3  # of all beams: those that are left have to show the place


@dataclass(frozen=True, slots=True)
class ScanAgreement:
    """Ratios of the returned beams of a scan.

    `inliers` agree with the map: at walls wholly, in free space or behind another wall in part. `displaced` is the ratio of the
    beams that reach their wall which end somewhat behind it, and at no other. Of all beams, `early` end in free space before
    their wall, `at_wall` within decimetres of a wall, `on_wall` within a cell of it, `late` 5 to 40 cm behind their wall, and
    `passing` farther behind it.
    """

    inliers: float
    displaced: float
    early: float
    at_wall: float
    on_wall: float
    late: float
    passing: float


def agreement_of(beams: Beams, pose: Floats, distances: Floats, visibility: VisibilityField) -> ScanAgreement:
    """The agreement of a scan with the map at a pose `(3,)`; `distances` `(m,)` (m) are those of its endpoints to walls."""
    bearings, ranges = beams.bearings[beams.returned], beams.ranges[beams.returned]
    aside = np.arctan2(visibility.slack_m, ranges)
    around = np.concatenate([bearings, bearings + aside, bearings - aside])
    expected = visibility.caster.ranges(pose[None], around, beams.extrinsics, beams.max_range_m)[0]
    expected = expected.reshape(3, -1)
    farthest = expected.max(axis=0)
    at_wall = distances < WALL_TOLERANCE_M
    blocked = farthest < ranges - visibility.tolerance_m
    early = ~at_wall & (ranges < expected[0] - visibility.tolerance_m)
    weights = np.where(at_wall, np.where(blocked, BEHIND_WALL_WEIGHT, 1.0), OPEN_SPACE_WEIGHT * early)
    reaches = ~blocked & (ranges > expected[0] - visibility.tolerance_m)
    displaced = reaches & (distances > DISPLACED_M) & (ranges > farthest + DISPLACED_M)
    near_m = max(ON_WALL_M, visibility.field.geometry.resolution_m)
    off = (distances > near_m) & (ranges > farthest + near_m)
    return ScanAgreement(
        inliers=float(weights.mean()),
        displaced=float(displaced.sum() / max(int(reaches.sum()), 1)),
        early=float(early.mean()),
        at_wall=float(at_wall.mean()),
        on_wall=float((at_wall & (distances <= near_m)).mean()),
        late=float((off & ~blocked).mean()),
        passing=float((off & blocked).mean()),
    )


class MapEvidence:
    """The ratios of the scans over the last metres, as long as the estimate follows the odometry."""

    def __init__(self) -> None:
        self._sums = np.zeros(6)  # of the weights, and of early, at_wall, on_wall, late and passing
        self._travel_m = 0.0
        self._pose: Floats | None = None

    def restart(self) -> None:
        """Forget all scans, as when the estimate is of another place."""
        self._sums[:] = 0.0
        self._travel_m = 0.0

    def add(self, agreement: ScanAgreement, pose: Floats, step: Floats) -> None:
        """Add a scan at the estimated pose `(3,)`; `step` `(3,)` is the robot's motion since the last one."""
        if self._pose is not None:
            away = pose - se2.compose(self._pose, step)
            if math.hypot(away[0], away[1]) > MOVED_M:
                self.restart()
        self._pose = pose
        step_m = math.hypot(step[0], step[1])
        self._travel_m += step_m
        self._sums *= math.exp(-step_m / MEMORY_M)
        self._sums += max(step_m, STANDING_WEIGHT_M) * np.array(
            [
                1.0,
                agreement.early,
                agreement.at_wall,
                agreement.on_wall,
                agreement.late,
                agreement.passing,
            ]
        )

    @property
    def late_ratio(self) -> float:
        """Ratio of the beams that end 5 to 40 cm behind their wall, of those that do not end in free space."""
        weight, early, _, _, late, _ = self._sums
        return float(late / max(weight - early, 1e-9))

    @property
    def is_consistent(self) -> bool:
        """Whether nothing in the last metres contradicts the pose: few beams pass walls, and those at walls end on them."""
        weight, early, at_wall, on_wall, late, passing = self._sums
        return bool(
            self._travel_m >= MIN_TRAVEL_M
            and late + passing <= MAX_PASSING_RATIO * (weight - early)
            and on_wall >= MIN_ON_WALL_RATIO * at_wall
            and at_wall >= MIN_AT_WALL_RATIO * weight
        )
