"""The number that a driver writes for "no return", by its coming again as the largest reading of many scans.

The farthest thing in view is a corner or an edge, met by a single beam, and another one from each place. A number that many beams
read exactly, far beyond all others, and in scan after scan, is none of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan

MIN_BEAMS = 5  # of a scan that read the code
GAP = 0.95  # no reading lies between this fraction of the code and the code: walls that end there have readings before it
MIN_SCANS = 8  # in which the same number was the largest


class NoReturnCodes:
    """Finds the code of one stream, from its first `scans` and those that are added."""

    def __init__(self, scans: Iterable[LaserScan] = ()) -> None:
        self.known: float | None = None
        self._seen: Counter[float] = Counter()
        for scan in scans:
            self.add(scan.ranges_m, scan.range_max_m)

    def add(self, ranges_m: NDArray[np.float32], range_max_m: float) -> None:
        """Take in the readings of a scan."""
        if self.known is not None:
            return
        inside = ranges_m[np.isfinite(ranges_m) & ((ranges_m < range_max_m) | (range_max_m == 0.0))]
        if len(inside) <= MIN_BEAMS:
            return
        largest = float(inside.max())
        if np.count_nonzero(inside > GAP * largest) != np.count_nonzero(inside == largest):
            return
        if np.count_nonzero(inside == largest) < MIN_BEAMS:
            return
        self._seen[largest] += 1
        if self._seen[largest] >= MIN_SCANS:
            self.known = largest
