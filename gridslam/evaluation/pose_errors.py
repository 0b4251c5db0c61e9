"""Absolute (APE) and relative (RPE) pose errors in the plane, as defined in evo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.stamps import NS_PER_S
from gridslam.evaluation.association import Pairs

DeltaUnit = Literal["frames", "metres", "seconds"]
RELATIVE_TOLERANCE = 0.1


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """Length (m) and absolute angle (deg) of error transforms, `(n,)` each."""

    translation_m: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Delta:
    """Distance between the two poses of an RPE pair: `size` frames, metres of path or seconds.

    Consecutive pairs start where the previous one ended, and end at the first pose at least `size` away. With `all_pairs`
    every pose starts a pair, which ends at the pose whose distance is nearest to `size`, within 10 % (evo's tolerance).
    """

    size: float = 1.0
    unit: DeltaUnit = "frames"
    all_pairs: bool = False


def absolute_errors(estimate: NDArray[np.float64], truth: NDArray[np.float64]) -> PoseErrors:
    """APE of poses `(n, 3)` in one frame: |p - p*| and |angle of R^-1 R*|."""
    offset = estimate[:, :2] - truth[:, :2]
    angle = se2.wrap_angle(truth[:, 2] - estimate[:, 2])
    return PoseErrors(np.hypot(offset[:, 0], offset[:, 1]), np.rad2deg(np.abs(angle)))


def relative_errors(pairs: Pairs, delta: Delta) -> PoseErrors:
    """RPE: the inverse of the true motion from i to j, composed with the estimated one (Sturm 2012, eq. 2)."""
    i, j = _index_pairs(pairs, delta)
    error = se2.between(
        se2.between(pairs.truth[i], pairs.truth[j]), se2.between(pairs.estimate[i], pairs.estimate[j])
    )
    return PoseErrors(np.hypot(error[:, 0], error[:, 1]), np.rad2deg(np.abs(error[:, 2])))


def _index_pairs(pairs: Pairs, delta: Delta) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    n = len(pairs)
    if delta.unit == "frames":
        step = int(delta.size)
        first = np.arange(0, max(n - step, 0), 1 if delta.all_pairs else step)
        return first, first + step
    steps = _steps(pairs, delta.unit)
    return _all_pairs(steps, delta.size) if delta.all_pairs else _consecutive_pairs(steps, delta.size)


def _steps(pairs: Pairs, unit: DeltaUnit) -> NDArray[np.float64]:
    """Path (m) or time (s) from each pose of the estimate to the next, `(n - 1,)`."""
    if unit == "seconds":
        return np.diff(pairs.stamps_ns) / NS_PER_S
    step = np.diff(pairs.estimate[:, :2], axis=0)
    return np.hypot(step[:, 0], step[:, 1])


def _consecutive_pairs(
    steps: NDArray[np.float64], size: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    ends, travelled = [0], 0.0
    for index, step in enumerate(steps.tolist(), start=1):
        travelled += step
        if travelled >= size:
            ends.append(index)
            travelled = 0.0
    chosen = np.array(ends, dtype=np.int64)
    return chosen[:-1], chosen[1:]


def _all_pairs(steps: NDArray[np.float64], size: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    travel = np.concatenate(([0.0], np.cumsum(steps)))
    first = np.arange(len(travel) - 1)
    after = np.clip(np.searchsorted(travel, travel[:-1] + size, side="left"), first + 1, len(travel) - 1)
    # Several poses have the same travel while the robot stands; evo takes the first of them.
    before = np.maximum(np.searchsorted(travel, travel[after - 1], side="left"), first + 1)
    to_after, to_before = (
        np.abs(travel[after] - travel[:-1] - size),
        np.abs(travel[before] - travel[:-1] - size),
    )
    last = np.where(to_before <= to_after, before, after)
    is_near = np.minimum(to_before, to_after) <= size * RELATIVE_TOLERANCE
    return first[is_near], last[is_near]
