"""Finds the number that a driver writes for "no return": the largest reading of many scans, always the same.

The farthest real reading of a scan is of a corner or an edge, on a single beam, and differs from place to place. A number that
many beams have exactly, far beyond all other readings, in scan after scan, is a code.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan

MIN_BEAMS = 5  # smallest number of beams of a scan that read the code
GAP = 0.95  # no reading lies between this fraction of the code and the code: walls that end there have readings before it
# Smallest number of scans in which the same number was the largest, and half of the last KEPT_SCANS
MIN_SCANS = 8
# Number of different scans that are kept: a robot that stands sees the same end of a corridor again and again
KEPT_SCANS = 40
CHANGED_M, MIN_CHANGED = 0.1, 0.5  # scans differ where this fraction of the readings has changed


class NoReturnCodes:
    """Finds the code of one stream, from its first `scans` and those that are added."""

    def __init__(self, scans: Iterable[LaserScan] = ()) -> None:
        self.known: float | None = None
        # The codes that scans show, 0 for none; of scans that differ only.
        self._seen: deque[float] = deque(maxlen=KEPT_SCANS)
        self._last: NDArray[np.float32] | None = None  # readings of the last of these
        for scan in scans:
            self.add(scan.ranges_m, scan.range_max_m)

    def add(self, ranges_m: NDArray[np.float32], range_max_m: float) -> None:
        """Add the ranges `(beams,)` (m) of a scan and its stated maximum range (m; 0: not stated)."""
        if self.known is not None:
            return
        if self._last is not None and not _differ(ranges_m, self._last):
            return
        self._last = ranges_m
        code = _largest_of_many(
            ranges_m[np.isfinite(ranges_m) & ((ranges_m < range_max_m) | (range_max_m == 0.0))]
        )
        self._seen.append(code)
        if code and self._seen.count(code) >= max(MIN_SCANS, len(self._seen) // 2):
            self.known = code


def _largest_of_many(inside: NDArray[np.float32]) -> float:
    """The largest of a scan's readings, if many beams read it and nothing comes near it; else 0."""
    if len(inside) <= MIN_BEAMS:
        return 0.0
    largest = float(inside.max())
    count = int(np.count_nonzero(inside == np.float32(largest)))
    is_alone = np.count_nonzero(inside > GAP * largest) == count
    return largest if is_alone and count >= MIN_BEAMS else 0.0


def _differ(ranges_m: NDArray[np.float32], others_m: NDArray[np.float32]) -> bool:
    """Whether most readings of two scans differ; scans of other beams do."""
    if len(ranges_m) != len(others_m):
        return True
    both = np.isfinite(ranges_m) & np.isfinite(others_m)
    changed = np.abs(ranges_m[both] - others_m[both]) > CHANGED_M
    return int(np.count_nonzero(changed)) > MIN_CHANGED * len(changed)
