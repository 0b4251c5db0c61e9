"""Finds a constant offset between the clocks of an estimate and the ground truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gridslam.core.trajectory import Trajectory
from gridslam.evaluation.alignment import find_alignment
from gridslam.evaluation.pose_errors import absolute_errors

MAX_OFFSET_S, COARSE_STEP_S = 10.0, 0.1
MAX_POSES = 200  # largest number of poses of the estimate, evenly spaced
MIN_OVERLAP = 0.7  # smallest fraction of these poses within the truth
REFINEMENTS = 3  # each divides the step by ten


@dataclass(frozen=True, slots=True)
class TimeOffset:
    """Offset (s) that is added to the estimate's stamps, and the position error (rmse, m) after rigid alignment."""

    offset_s: float
    rmse_m: float


def find_time_offset(estimate: Trajectory, truth: Trajectory) -> TimeOffset | None:
    """The offset with the smallest error, by grid search within MAX_OFFSET_S and around a common start; None without overlap."""
    path, reference = estimate.sorted(), truth.sorted()
    if len(path) < 3 or len(reference) < 3:
        return None
    chosen = np.unique(np.linspace(0, len(path) - 1, MAX_POSES).astype(np.int64))
    sparse = Trajectory(path.stamps_ns[chosen], path.poses[chosen])
    steps = round(MAX_OFFSET_S / COARSE_STEP_S)
    same_start_s = (int(reference.stamps_ns[0]) - int(path.stamps_ns[0])) / 1e9
    grid = COARSE_STEP_S * np.arange(-steps, steps + 1)
    nearby = same_start_s + COARSE_STEP_S * np.arange(-10, 11)
    best = _best(sparse, reference, np.concatenate([grid, nearby]).tolist())
    step_s = COARSE_STEP_S
    for _ in range(REFINEMENTS - 1):
        if best is None:
            return None
        step_s *= 0.1
        best = _best(sparse, reference, [best.offset_s + step_s * k for k in range(-10, 11)])
    return best


def _best(estimate: Trajectory, truth: Trajectory, offsets_s: Iterable[float]) -> TimeOffset | None:
    best: TimeOffset | None = None
    for offset_s in offsets_s:
        poses, inside = truth.at(estimate.stamps_ns + round(offset_s * 1e9))
        if np.count_nonzero(inside) < max(MIN_OVERLAP * len(estimate), 3):
            continue
        moved, true = estimate.poses[inside], poses[inside]
        found = find_alignment(moved, true, "se2")
        if found is None:
            continue
        error = float(np.sqrt((absolute_errors(found.apply(moved), true).translation_m ** 2).mean()))
        if best is None or error < best.rmse_m:
            best = TimeOffset(offset_s, error)
    return best
