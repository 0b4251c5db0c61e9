"""The error of a trajectory at each moment, for the report's plots (`evaluate` gives the measures)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory

FEWEST_POSES = 2


@dataclass(frozen=True, slots=True)
class Errors:
    """At stamps `(n,)`: distance (m) and absolute angle (deg) between the aligned estimate and the truth."""

    stamps_ns: NDArray[np.int64]
    translation_m: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]


def errors_over_time(estimate: Trajectory, truth: Trajectory, is_aligned: bool) -> Errors | None:
    """Errors at the estimate's stamps that the truth covers; None when fewer than two do.

    With `is_aligned` after the rigid motion that fits the positions best: a map's own frame is arbitrary.
    """
    path = estimate.sorted()
    true_poses, inside = truth.sorted().at(path.stamps_ns)
    if np.count_nonzero(inside) < FEWEST_POSES:
        return None
    stamps, found, true = path.stamps_ns[inside], path.poses[inside], true_poses[inside]
    T_true_map = align(found[:, :2], true[:, :2]) if is_aligned else np.zeros(3)
    difference = se2.between(true, se2.compose(T_true_map, found))
    return Errors(stamps, np.hypot(difference[:, 0], difference[:, 1]), np.rad2deg(np.abs(difference[:, 2])))


def align(source_xy: NDArray[np.float64], target_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """T_target_source `(3,)` of least squared distance between points `(n, 2)` (Umeyama 1991, no scale)."""
    source_mean, target_mean = source_xy.mean(axis=0), target_xy.mean(axis=0)
    s, t = source_xy - source_mean, target_xy - target_mean
    yaw = float(np.arctan2((s[:, 0] * t[:, 1] - s[:, 1] * t[:, 0]).sum(), (s * t).sum()))
    cos, sin = np.cos(yaw), np.sin(yaw)
    shift = target_mean - np.array([[cos, -sin], [sin, cos]]) @ source_mean
    return np.array([shift[0], shift[1], yaw])
