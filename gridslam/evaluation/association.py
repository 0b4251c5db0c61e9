"""Pairs of poses of an estimate and the ground truth, by their stamps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory

Sync = Literal["nearest", "interpolate"]
DEFAULT_MAX_DIFFERENCE_NS = 10_000_000


@dataclass(frozen=True, slots=True)
class Pairs:
    """Paired poses `(n, 3)` of both trajectories, and the stamps `(n,)` (ns) of the estimated ones."""

    stamps_ns: NDArray[np.int64]
    estimate: NDArray[np.float64]
    truth: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.stamps_ns)


def associate(
    estimate: Trajectory,
    truth: Trajectory,
    sync: Sync = "nearest",
    max_difference_ns: int = DEFAULT_MAX_DIFFERENCE_NS,
) -> Pairs:
    """Pair the poses of two trajectories sorted by stamp, as evo does.

    Each pose of the trajectory with fewer poses (the estimate if both have the same number) is paired with the pose of the
    other that is nearest in time, at most `max_difference_ns` away; of two equally near ones the earlier. `interpolate` pairs
    the same poses and then interpolates the longer trajectory at the stamps of the shorter one. Without any pair the result
    is empty.
    """
    if not len(estimate) or not len(truth):
        return Pairs(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    estimate_is_short = len(estimate) <= len(truth)
    short, long = (estimate, truth) if estimate_is_short else (truth, estimate)
    in_short, in_long = match_nearest(short.stamps_ns, long.stamps_ns, max_difference_ns)
    stamps, short_poses = short.stamps_ns[in_short], short.poses[in_short]
    if sync == "interpolate":
        long_poses, _ = long.at(stamps)
        long_stamps = stamps
    else:
        long_poses, long_stamps = long.poses[in_long], long.stamps_ns[in_long]
    if estimate_is_short:
        return Pairs(stamps, short_poses, long_poses)
    return Pairs(long_stamps, long_poses, short_poses)


def match_nearest(
    stamps_ns: NDArray[np.int64], among_ns: NDArray[np.int64], max_difference_ns: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the stamps whose nearest neighbour in `among_ns` (sorted, not empty) is near enough, and of these neighbours."""
    after = np.clip(np.searchsorted(among_ns, stamps_ns, side="right"), 0, len(among_ns) - 1)
    before = np.maximum(after - 1, 0)
    to_after, to_before = np.abs(among_ns[after] - stamps_ns), np.abs(among_ns[before] - stamps_ns)
    nearest = np.where(to_after < to_before, after, before)
    is_near = np.minimum(to_after, to_before) <= max_difference_ns
    return np.flatnonzero(is_near).astype(np.int64), nearest[is_near].astype(np.int64)
