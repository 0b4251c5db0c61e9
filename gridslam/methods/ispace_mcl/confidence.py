"""The confidence that the filter's estimate is right: agreement of the scan with the map, and concentration of the particles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.particles import Belief
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.visibility import VisibilityField

Floats = NDArray[np.float64]

WALL_TOLERANCE_M = 0.25  # a beam that ends nearer to a wall agrees with the map
BLOCKED_TOLERANCE_M = 0.4  # unless a wall lies farther than this before its endpoint
GRAZING_SLACK_M = 0.3  # a beam whose endpoint becomes visible when moved aside by this much grazes a wall
# A beam that ends farther than this behind a wall, and at no other, shows the wall elsewhere
DISPLACED_M = 0.1
# A beam at a wall that ends farther than this, and than some cells, from it ends beside it. On right maps up to 24 % of them do
# (99 of 100 scans of three recorded logs; the median in two crowds is 5 %), on two maps of other places 43 and 77 %.
BESIDE_M, BESIDE_CELLS = 0.08, 1.6
# Largest ratio of the beams at walls that end beside them, for a pose that is trusted
MAX_BESIDE_RATIO = 0.28
# Largest mean ratio of displaced beams for such a pose. On right maps it was at most 0.039 in changed places and 0.011 elsewhere
# (1352 poses of 66 drives), on a map of another place 0.065 in the median.
MAX_DISPLACED_MEAN = 0.05
BEHIND_WALL_WEIGHT = 0.5  # weight of a beam that ends at a wall behind another one: furniture was moved
OPEN_SPACE_WEIGHT = 0.4  # weight of a beam that ends in free space: a person
HALF_CONFIDENCE_STD_M = 0.5  # standard deviation of the position that halves the confidence
SMOOTHING = 0.7  # weight of the past in the running mean of the inlier ratio: a mean over about three updates
LOCALIZED_CONFIDENCE = 0.7  # from this confidence on the status is localized,
# If the main cluster has this weight: the robot is elsewhere with a probability below 1 %
LOCALIZED_MASS = 0.99
# Factor of the confidence of a pose that is not confirmed: about as many such poses are right
UNTRUSTED_WEIGHT = 0.7
LOST_CONFIDENCE = 0.3  # below this confidence the status is lost


@dataclass(frozen=True, slots=True)
class InlierLimits:
    """Inlier ratios at which the confidence starts to rise from 0, and at which it is full."""

    min: float
    good: float


@dataclass(frozen=True, slots=True)
class Assessment:
    """Quality of an estimate.

    `inlier_ratio` is the running mean of the ratio of beams that agree with the map, `distance_m` the mean distance of the
    endpoints to walls. `confidence` in 0..1 is the product of the inlier ratio between its limits, the weight of the main
    cluster, and a factor that falls with the cluster's standard deviation. `status` is localized, uncertain or lost.
    `displaced_ratio` is the ratio of the scan's beams at walls that end somewhat behind their wall: people and furniture end
    beams early, and only a wall that stands elsewhere ends them late. `displaced_mean` is its running mean, `beside_ratio` that
    of the beams at walls that end beside their wall.
    """

    inlier_ratio: float
    distance_m: float
    confidence: float
    status: str
    displaced_ratio: float
    displaced_mean: float = 0.0
    beside_ratio: float = 0.0

    @property
    def is_contradicted(self) -> bool:
        """Whether more of the beams at walls end beside or behind them than on a right map."""
        return self.beside_ratio > MAX_BESIDE_RATIO or self.displaced_mean > MAX_DISPLACED_MEAN

    def without_trust(self) -> Assessment:
        """The assessment as long as another place may explain the scans about as well: not localized, and less confident."""
        status = "uncertain" if self.status == "localized" else self.status
        return replace(self, status=status, confidence=UNTRUSTED_WEIGHT * self.confidence)


@dataclass(frozen=True, slots=True)
class FilterUpdate:
    """Result of one update: the estimate that the config asks for, and the assessment of the main cluster.

    `std_m` is the standard deviation of the position over all particles (figure 10 of the paper).
    """

    belief: Belief
    assessment: Assessment
    particles: int
    std_m: float


class ConfidenceMonitor:
    """Assesses the estimate at every scan, with a running mean of the inlier ratio."""

    def __init__(self, limits: InlierLimits, visibility: VisibilityField) -> None:
        self._limits = limits
        self._visibility = visibility
        self._inlier_ratio: float | None = None
        self._beside_ratio: float | None = None
        self._displaced_ratio: float | None = None
        self._beside_m = max(BESIDE_M, BESIDE_CELLS * visibility.field.geometry.resolution_m)

    def restart(self) -> None:
        """Reset the running means, after the particles were moved elsewhere."""
        self._inlier_ratio = self._beside_ratio = self._displaced_ratio = None

    def assess(self, belief: Belief, beams: Beams) -> Assessment:
        """The assessment of the main cluster by all beams of a scan."""
        distance, displaced = float("nan"), 0.0
        if len(beams.points):
            distances = self._visibility.field.distances_at(beams.points, belief.mean)
            distance = float(distances.mean())
            present, displaced = self._ratios_of(beams, belief.mean, distances)
            self._inlier_ratio = _running_mean(self._inlier_ratio, present)
            self._displaced_ratio = _running_mean(self._displaced_ratio, displaced)
            at_wall = distances[distances < WALL_TOLERANCE_M]
            if len(at_wall):
                beside = float((at_wall > self._beside_m).mean())
                self._beside_ratio = _running_mean(self._beside_ratio, beside)
        inlier_ratio = self._inlier_ratio or 0.0
        confidence = confidence_of(inlier_ratio, belief, self._limits)
        status = _status(confidence, belief.mass)
        return Assessment(
            inlier_ratio,
            distance,
            confidence,
            status,
            displaced_ratio=displaced,
            displaced_mean=self._displaced_ratio or 0.0,
            beside_ratio=self._beside_ratio or 0.0,
        )

    def _ratios_of(self, beams: Beams, pose: Floats, distances: Floats) -> tuple[float, float]:
        """Ratios of the returned beams that agree with the map from a pose, and of beams at walls that are displaced.

        A beam that ends at a wall behind another one may show moved furniture; one that ends in free space may show a person:
        they agree in part. `distances` `(m,)` are those of the endpoints to walls, m.
        """
        visibility = self._visibility
        bearings, ranges = beams.bearings[beams.returned], beams.ranges[beams.returned]
        aside = np.arctan2(visibility.slack_m, ranges)
        around = np.concatenate([bearings, bearings + aside, bearings - aside])
        expected = visibility.caster.ranges(pose[None], around, beams.extrinsics, beams.max_range_m)[0]
        expected = expected.reshape(3, -1)
        at_wall = distances < WALL_TOLERANCE_M
        blocked = (expected < ranges - visibility.tolerance_m).all(axis=0)
        in_open_space = ~at_wall & (ranges < expected[0] - visibility.tolerance_m)
        weights = np.where(
            at_wall, np.where(blocked, BEHIND_WALL_WEIGHT, 1.0), OPEN_SPACE_WEIGHT * in_open_space
        )
        reaches = ~blocked & (ranges > expected[0] - visibility.tolerance_m)
        is_late = (distances > DISPLACED_M) & (ranges > expected.max(axis=0) + DISPLACED_M)
        return float(weights.mean()), float((reaches & is_late).sum() / max(int(reaches.sum()), 1))


def _running_mean(past: float | None, present: float) -> float:
    return SMOOTHING * (present if past is None else past) + (1.0 - SMOOTHING) * present


def confidence_of(inlier_ratio: float, belief: Belief, limits: InlierLimits) -> float:
    """Confidence from 0 to 1 by inlier ratio, weight of the main cluster and its standard deviation."""
    by_inliers = np.clip((inlier_ratio - limits.min) / max(limits.good - limits.min, 1e-9), 0.0, 1.0)
    by_std = 1.0 / (1.0 + (belief.std_m / HALF_CONFIDENCE_STD_M) ** 2)
    return float(by_inliers * min(belief.mass, 1.0) * by_std)


def _status(confidence: float, mass: float) -> str:
    if confidence >= LOCALIZED_CONFIDENCE and mass >= LOCALIZED_MASS:
        return "localized"
    return "lost" if confidence < LOST_CONFIDENCE else "uncertain"
