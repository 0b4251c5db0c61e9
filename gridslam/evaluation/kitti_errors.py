"""KITTI's odometry errors: drift over sub-trajectories of 100 to 800 m (Geiger et al., CVPR 2012), in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

LENGTHS_M = (100, 200, 300, 400, 500, 600, 700, 800)
START_STEP = 10  # every tenth pose starts sub-trajectories


@dataclass(frozen=True, slots=True)
class KittiErrors:
    """Mean translation error (% of the length), rotation error (deg per 100 m), number of sub-trajectories."""

    t_rel_percent: float
    r_rel_deg_per_100m: float
    count: int


def kitti_errors(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> KittiErrors | None:
    """The errors of paired poses `(n, 3)`; None if the true path is shorter than the shortest sub-trajectory.

    As in KITTI's development kit a sub-trajectory ends at the first pose whose true path length from the start exceeds the
    length. Lengths are those of the true path.
    """
    travel = travel_of(truth)
    starts = np.arange(0, len(truth), START_STEP)
    translation, rotation = [], []
    for length in LENGTHS_M:
        ends = np.searchsorted(travel, travel[starts] + length, side="right") if len(travel) else starts
        inside = ends < len(truth)
        first, last = starts[inside], ends[inside]
        error = se2.between(
            se2.between(estimate[first], estimate[last]), se2.between(truth[first], truth[last])
        )
        translation.append(np.hypot(error[:, 0], error[:, 1]) / length)
        rotation.append(np.abs(error[:, 2]) / length)
    t, r = np.concatenate(translation), np.concatenate(rotation)
    if not len(t):
        return None
    return KittiErrors(100.0 * float(t.mean()), 100.0 * float(np.degrees(r.mean())), len(t))


def travel_of(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Path length (m) from the first pose to each of the poses `(n, 3)`."""
    steps = np.diff(poses[:, :2], axis=0)
    return np.concatenate([np.zeros(min(len(poses), 1)), np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))])
