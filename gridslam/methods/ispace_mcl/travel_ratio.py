"""Compares the robot's travel on the map with that of its odometry: a difference shows a wrong scale, or a wrong place."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Travel by odometry in a window: an error of the poses of some centimetres is a few percent of it
WINDOW_M = 1.0
MAX_STEP_M = 0.5  # a longer step between two scans is a jump of the odometry or of the estimate
MIN_WINDOWS = 3
MAX_IQR = 0.15  # relative; where the ratio varies more, wheels have slipped, or people have hidden the walls
MIN_RATIO = 1.15  # smallest ratio that is a fault; good odometry is within a tenth
MIN_JUMP_M, MAX_DRIFT_RATIO = 2.0, 0.2  # what is farther than the odometry may have drifted since is a jump


def travel_ratio(poses: Floats, odometry: Floats, is_localized: Bools) -> float:
    """Travel on the map over travel by odometry, 1 without clear evidence of a difference.

    `poses` and `odometry` `(n, 3)` are those of all scans. Only stretches count over which the robot was localized throughout.
    """
    moved, by_odometry = (np.hypot(*np.diff(path[:, :2], axis=0).T) for path in (poses, odometry))
    is_interrupted = ~is_localized[1:] | (moved > MAX_STEP_M) | (by_odometry > MAX_STEP_M)
    ratios = []
    for first, last in pairwise([-1, *np.flatnonzero(is_interrupted).tolist(), len(moved)]):
        ratios += _ratios(poses[first + 1 : last + 1, :2], odometry[first + 1 : last + 1, :2])
    if len(ratios) < MIN_WINDOWS:
        return 1.0
    low, ratio, high = np.quantile(ratios, [0.25, 0.5, 0.75]).tolist()
    is_clear = max(ratio, 1.0 / ratio) > MIN_RATIO and high - low < MAX_IQR * ratio
    return float(ratio) if is_clear else 1.0


def jumps_m(poses: Floats, odometry: Floats, is_localized: Bools) -> Floats:
    """Lengths `(k,)` (m) of the jumps of localized poses from the pose before, moved by the odometry.

    `poses` and `odometry` `(n, 3)` are those of all scans. A robot that was carried jumps as well.
    """
    rows = np.flatnonzero(is_localized)
    motion = se2.between(odometry[rows[:-1]], odometry[rows[1:]])
    away = se2.between(se2.compose(poses[rows[:-1]], motion), poses[rows[1:]])
    distance = np.hypot(away[:, 0], away[:, 1])
    travel = cumulative_distance(odometry)
    limit = MIN_JUMP_M + MAX_DRIFT_RATIO * (travel[rows[1:]] - travel[rows[:-1]])
    return np.asarray(distance[distance > limit])


def _ratios(positions: Floats, odometry: Floats) -> list[float]:
    """The ratio of the distances over each window of a stretch `(n, 2)`."""
    ratios, start = [], 0
    for row in range(len(odometry)):
        distance = float(np.hypot(*(odometry[row] - odometry[start])))
        if distance >= WINDOW_M:
            ratios.append(max(float(np.hypot(*(positions[row] - positions[start]))), 1e-3) / distance)
            start = row
    return ratios
