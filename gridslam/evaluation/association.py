"""Pairs of poses of an estimate and the ground truth, by their stamps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory

Sync = Literal["nearest", "interpolate"]
DEFAULT_MAX_DIFFERENCE_NS = 10_000_000
# At an acceleration of a, a pose between two others is wrong by up to a * gap^2 / 8: 12 cm at 1 m/s^2 and one second.
DEFAULT_MAX_GAP_NS = 1_000_000_000


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
    max_difference_ns: int | None = None,
    max_gap_ns: int = DEFAULT_MAX_GAP_NS,
) -> Pairs:
    """Pair the poses of two trajectories sorted by stamp; the result may be empty.

    The poses of the shorter trajectory (the estimate if both have the same number of poses) are paired with the other one.
    `nearest`: with its pose that is nearest in time, at most `max_difference_ns` away (default 10 ms); of two equally near
    ones the earlier. `interpolate`: with the pose interpolated between its two neighbours in time, if these are at most
    `max_gap_ns` apart. If `max_difference_ns` is given too, the nearer neighbour must be that near, and an end of the
    trajectory that is so near serves as it is: the poses that evo pairs.
    """
    if not len(estimate) or not len(truth):
        return Pairs(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
    estimate_is_short = len(estimate) <= len(truth)
    short, long = (estimate, truth) if estimate_is_short else (truth, estimate)
    if sync == "interpolate":
        in_short = _between_neighbours(short.stamps_ns, long.stamps_ns, max_difference_ns, max_gap_ns)
        long_stamps = short.stamps_ns[in_short]
        long_poses, _ = long.at(long_stamps)
    else:
        largest = DEFAULT_MAX_DIFFERENCE_NS if max_difference_ns is None else max_difference_ns
        in_short, in_long = match_nearest(short.stamps_ns, long.stamps_ns, largest)
        long_poses, long_stamps = long.poses[in_long], long.stamps_ns[in_long]
    short_poses = short.poses[in_short]
    if estimate_is_short:
        return Pairs(short.stamps_ns[in_short], short_poses, long_poses)
    return Pairs(long_stamps, long_poses, short_poses)


def _between_neighbours(
    stamps_ns: NDArray[np.int64],
    among_ns: NDArray[np.int64],
    max_difference_ns: int | None,
    max_gap_ns: int,
) -> NDArray[np.int64]:
    """Indices of the stamps at which a trajectory with the stamps `among_ns` (sorted, not empty) may be interpolated."""
    after = np.searchsorted(among_ns, stamps_ns, side="left")
    right = among_ns[np.minimum(after, len(among_ns) - 1)]
    left = among_ns[np.maximum(after - 1, 0)]
    is_inside = (stamps_ns >= among_ns[0]) & (stamps_ns <= among_ns[-1])
    is_narrow = (right - left <= max_gap_ns) | (stamps_ns == right)
    if max_difference_ns is None:
        return np.flatnonzero(is_inside & is_narrow).astype(np.int64)
    near, _ = match_nearest(stamps_ns, among_ns, max_difference_ns)
    return np.asarray(near[(is_narrow | ~is_inside)[near]], np.int64)


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
