"""What is kept of every stop, and what ties one to the next."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.ir_scan.matching import Verdict
from gridslam.motion.wheel_gyro import Stretch
from gridslam.sensors.infrared import BeamEnds, InfraredScan

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Factor:
    """A pose that something measured, with its covariance `(3, 3)`."""

    pose: Floats
    covariance: Floats


@dataclass(slots=True)
class Place:
    """The start (without scan) or a stop: T_map_base `(3,)` as it is believed now, and as it was before its match.

    `stretch` is the motion from the place before, which says something only where the log `has_odometry`. `fixes` are poses
    from outside.
    """

    stamp_ns: int
    pose: Floats
    covariance: Floats
    predicted: Floats
    stretch: Stretch | None
    has_odometry: bool = True
    scan: InfraredScan | None = None
    ends: BeamEnds | None = None
    verdict: Verdict = "off"
    score: float = 0.0
    fixes: list[Factor] = field(default_factory=list)
