"""Moments from which on the scans do not continue those before: the robot was carried, or its lidar was turned or moved."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.front_end import MIN_CORRESPONDENCES, ScanMatch

# A scan is foreign if a smaller fraction of its points lies on surfaces of the local map. On recorded logs and in crowds all but
# single scans have 0.42 or more; after a robot was carried away it is below 0.1, until the local map has the new place.
MAX_FOREIGN_INLIER_RATIO = 0.3
# A break has this number of foreign scans among the last ones: a single one may be covered
RECENT_SCANS, MIN_FOREIGN = 5, 3


class ScanBreaks:
    """Finds the stamps at which scans become foreign."""

    def __init__(self) -> None:
        self._first_ns: int | None = None
        self._recent: deque[tuple[int, bool]] = deque(maxlen=RECENT_SCANS)
        # Whether the scans before continue each other; the first ones have no map yet
        self._continues = False
        self.stamps_ns: list[int] = []

    def add(self, stamp_ns: int, match: ScanMatch, points: int) -> None:
        """Add a scan's match and number of points; scans of few points show nothing."""
        if self._first_ns is None:
            self._first_ns = stamp_ns
        if points < MIN_CORRESPONDENCES:
            return
        is_foreign = not match.is_matched or match.inlier_ratio < MAX_FOREIGN_INLIER_RATIO
        self._recent.append((stamp_ns, is_foreign))
        foreign_ns = [stamp for stamp, foreign in self._recent if foreign]
        if self._continues and len(foreign_ns) >= MIN_FOREIGN:
            self.stamps_ns.append(foreign_ns[0])
            self._continues = False
        elif len(self._recent) == RECENT_SCANS and not foreign_ns:
            self._continues = True

    def doubt(self, loops_ns: NDArray[np.int64]) -> str | None:
        """The reason, in words, to distrust the path; None without a break that no loop closure spans.

        `loops_ns` `(k, 2)` are the stamps of the scans that loop closures join.
        """
        first, last = loops_ns.min(axis=1, initial=2**62), loops_ns.max(axis=1, initial=-(2**62))
        unspanned = [stamp for stamp in self.stamps_ns if not ((first < stamp) & (stamp <= last)).any()]
        if not unspanned or self._first_ns is None:
            return None
        time_s = (unspanned[0] - self._first_ns) * 1e-9
        return (
            f"the scans from {time_s:.1f} s on do not continue those before (was the robot carried, or its lidar turned?), and "
            f"nothing shows where they belong: map the parts as two drives, with --end {time_s:.1f}, and with --start "
            f"{time_s:.1f} and --continue"
        )
