"""A trajectory: stamps and poses in recorded order."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2


@dataclass(frozen=True, slots=True)
class Trajectory:
    """`stamps_ns` int64 `(n,)`, `poses` float64 `(n, 3)` of x, y, yaw in the map frame."""

    stamps_ns: NDArray[np.int64]
    poses: NDArray[np.float64]

    def __post_init__(self) -> None:
        if self.poses.shape != (len(self.stamps_ns), 3):
            raise ValueError(f"{len(self.stamps_ns)} stamps but poses of shape {self.poses.shape}")

    def __len__(self) -> int:
        return len(self.stamps_ns)

    @staticmethod
    def empty() -> Trajectory:
        """A trajectory without poses."""
        return Trajectory(np.zeros(0, np.int64), np.zeros((0, 3)))

    def sorted(self) -> Trajectory:
        """The poses sorted by stamp (stable); of equal stamps the first is kept."""
        order = np.argsort(self.stamps_ns, kind="stable")
        stamps = self.stamps_ns[order]
        keep = np.r_[True, stamps[1:] != stamps[:-1]] if len(stamps) else np.zeros(0, bool)
        return Trajectory(stamps[keep], self.poses[order][keep])

    def at(self, stamps_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Interpolated poses `(m, 3)` at stamps `(m,)`, and a mask `(m,)` of the stamps within the trajectory.

        The trajectory must be sorted by stamp. Outside it, the pose is that of the nearest end and the mask is False.
        """
        query = np.asarray(stamps_ns, dtype=np.int64)
        if not len(self):
            return np.zeros((len(query), 3)), np.zeros(len(query), bool)
        inside = (query >= self.stamps_ns[0]) & (query <= self.stamps_ns[-1])
        right = np.clip(np.searchsorted(self.stamps_ns, query, side="left"), 1, max(len(self) - 1, 1))
        right = np.minimum(right, len(self) - 1)
        left = np.maximum(right - 1, 0)
        span = np.maximum(self.stamps_ns[right] - self.stamps_ns[left], 1)
        fraction = np.clip((query - self.stamps_ns[left]) / span, 0.0, 1.0)
        return se2.interpolate(self.poses[left], self.poses[right], fraction), inside


def time_windows(
    stamps_ns: NDArray[np.int64], window_s: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and last indices `(m,)` of windows of about `window_s` without gaps, which start at different stamps of `(n,)`."""
    times_s = (stamps_ns - stamps_ns[:1]) * 1e-9
    ends = np.searchsorted(times_s, times_s + window_s)
    starts = np.flatnonzero(ends < len(times_s))
    ends = ends[starts]
    whole = times_s[ends] - times_s[starts] < 2.0 * window_s
    return starts[whole].astype(np.int64), ends[whole].astype(np.int64)


def stretches(stamps_ns: NDArray[np.int64], mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """First and last stamps `(k, 2)` of the uninterrupted runs of True in a mask `(n,)` over stamps `(n,)`."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return np.stack([stamps_ns[change[::2]], stamps_ns[change[1::2] - 1]], axis=1)


def pose_at(
    stamp_ns: int,
    stamps_ns: Sequence[int],
    poses: Sequence[NDArray[np.float64]],
    max_gap_ns: int | None = None,
) -> NDArray[np.float64] | None:
    """The pose `(3,)` at a stamp, interpolated between the poses before and after it.

    `stamps_ns` ascend, one for each of `poses`. None for a stamp before the first or after the last of them, and between two
    poses that are `max_gap_ns` or more apart.
    """
    after = bisect_left(stamps_ns, stamp_ns)
    if after == len(stamps_ns) or (after == 0 and stamps_ns[0] != stamp_ns):
        return None
    if stamps_ns[after] == stamp_ns:
        return poses[after]
    span_ns = stamps_ns[after] - stamps_ns[after - 1]
    if max_gap_ns is not None and span_ns >= max_gap_ns:
        return None
    fraction = (stamp_ns - stamps_ns[after - 1]) / span_ns
    return se2.interpolate(poses[after - 1], poses[after], fraction)
