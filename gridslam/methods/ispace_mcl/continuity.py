"""Whether a scan continues the one before it, or the robot was carried elsewhere in between, which the odometry does not show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced

Floats = NDArray[np.float64]

NEAR_M = 0.3  # a point nearer than this to the other scan continues it
MAX_POINTS = 180  # largest number of points of each scan
MIN_POINTS = 10  # with fewer points nothing is known
# Overlaps of consecutive scans of recorded drives are above 0.5 in all but a few, also in crowds that hide half the view. Where
# the robot was carried elsewhere most are below 0.4.
DISCONTINUOUS_OVERLAP = 0.5  # below this overlap the robot may have been carried
WHOLE_OVERLAP = 0.6  # from this overlap on the robot was hardly carried


def overlap_of(before: Floats, after: Floats, step: Floats) -> float:
    """Ratio of the points of two scans `(m, 2)` that lie at the other scan after a step T_before_after `(3,)`; 1 if unknown.

    The smaller of the two ratios: one scan may see but a part of the other.
    """
    if min(len(before), len(after)) < MIN_POINTS:
        return 1.0
    known, moved = _thinned(before), se2.transform_points(step, _thinned(after))
    # All pairs: with so few points a tree takes five times as long.
    off_x, off_y = (known[:, None, axis] - moved[:, axis] for axis in (0, 1))
    is_near = off_x * off_x + off_y * off_y < NEAR_M**2
    return float(min(is_near.any(axis=0).mean(), is_near.any(axis=1).mean()))


def _thinned(points: Floats) -> Floats:
    return points[evenly_spaced(len(points), MAX_POINTS)]
