"""Stops: the places where the robot stood and scanned, and the motion between them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.motion.wheel_gyro import RelativeMotion
from gridslam.sensors.infrared import InfraredScan, ReliableReadings

Floats = NDArray[np.float64]
Verdict = Literal["matched", "first", "too_few_points", "no_match", "ambiguous", "off"]


@dataclass(frozen=True, slots=True)
class StopMatch:
    """T_map_base `(3,)` of a stop after matching, its covariance `(3, 3)`, the verdict, and the best sum per reading.

    Verdicts: matched; first (there is no map yet), too_few_points, no_match and ambiguous, which keep the predicted pose; off
    (the match was not tried).
    """

    pose: Floats
    covariance: Floats
    verdict: Verdict
    score: float = 0.0


@dataclass(frozen=True, slots=True)
class MeasuredPose:
    """A measured T_map_base `(3,)` with its covariance `(3, 3)`."""

    pose: Floats
    covariance: Floats


@dataclass(slots=True)
class Stop:
    """The start (without scan) or a stop: T_map_base `(3,)`, its covariance `(3, 3)`, and the pose `predicted` before the match.

    `motion` is the odometry from the previous stop to this one; it is meaningful only with `has_odometry`. `absolute_poses` were
    measured from outside the robot, for example by a tracking system.
    """

    stamp_ns: int
    pose: Floats
    covariance: Floats
    predicted: Floats
    motion: RelativeMotion | None
    has_odometry: bool = True
    scan: InfraredScan | None = None
    readings: ReliableReadings | None = None
    verdict: Verdict = "off"
    score: float = 0.0
    absolute_poses: list[MeasuredPose] = field(default_factory=list)
