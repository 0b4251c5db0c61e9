"""The confidence that the filter's estimate is right: agreement of the scan with the map, and concentration of the particles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.filters.particles import Belief
from gridslam.methods.ispace_mcl.scan_agreement import WALL_TOLERANCE_M, MapEvidence, agreement_of
from gridslam.sensors.lidar_beams import Beams
from gridslam.sensors.visibility import VisibilityField

Floats = NDArray[np.float64]

# A beam at a wall that ends farther than this, and than some cells, from it ends beside it. On right maps up to 24 % of them do
# (99 of 100 scans of three recorded logs; the median in two crowds is 5 %), on two maps of other places 43 and 77 %.
BESIDE_M, BESIDE_CELLS = 0.08, 1.6
# Largest ratio of the beams at walls that end beside them, for a pose that is trusted
MAX_BESIDE_RATIO = 0.28
# Largest ratio over the last metres of beams that end 5 to 40 cm behind their wall, for such a pose. The mean over right poses
# of a drive was at most 0.02 in places made by seed and on recorded maps, aged ones too: where a wall is gone, beams go farther.
MAX_LATE_RATIO = 0.03
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
    beams early, and only a wall that stands elsewhere ends them late. `beside_ratio` is the running mean of the ratio of the
    beams at walls that end beside them, `late_ratio` the mean over the last metres of those that end a little behind them.
    `is_consistent`: nothing in the last metres contradicts the pose.
    """

    inlier_ratio: float
    distance_m: float
    confidence: float
    status: str
    displaced_ratio: float
    beside_ratio: float = 0.0
    late_ratio: float = 0.0
    is_consistent: bool = False

    @property
    def is_contradicted(self) -> bool:
        """Whether more of the beams at walls end beside or behind them than on a right map."""
        return self.beside_ratio > MAX_BESIDE_RATIO or self.late_ratio > MAX_LATE_RATIO

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
        self._evidence = MapEvidence()
        self._beside_m = max(BESIDE_M, BESIDE_CELLS * visibility.field.geometry.resolution_m)

    def restart(self) -> None:
        """Reset the running means, after the particles were moved elsewhere."""
        self._inlier_ratio = self._beside_ratio = None
        self._evidence.restart()

    def assess(self, belief: Belief, beams: Beams, step: Floats) -> Assessment:
        """The assessment of the main cluster by all beams of a scan; `step` `(3,)` is the motion since the last one."""
        distance, displaced = float("nan"), 0.0
        if len(beams.points):
            distances = self._visibility.field.distances_at(beams.points, belief.mean)
            distance = float(distances.mean())
            agreement = agreement_of(beams, belief.mean, distances, self._visibility)
            displaced = agreement.displaced
            self._inlier_ratio = _running_mean(self._inlier_ratio, agreement.inliers)
            self._evidence.add(agreement, belief.mean, step)
            at_wall = distances[distances < WALL_TOLERANCE_M]
            if len(at_wall):
                beside = float((at_wall > self._beside_m).mean())
                self._beside_ratio = _running_mean(self._beside_ratio, beside)
        inlier_ratio = self._inlier_ratio or 0.0
        is_consistent = self._evidence.is_consistent
        # People and new things are no sign of a wrong pose where nothing else is
        confidence = confidence_of(1.0 if is_consistent else inlier_ratio, belief, self._limits)
        return Assessment(
            inlier_ratio,
            distance,
            confidence,
            _status(confidence, belief.mass),
            displaced_ratio=displaced,
            beside_ratio=self._beside_ratio or 0.0,
            late_ratio=self._evidence.late_ratio,
            is_consistent=is_consistent,
        )


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
