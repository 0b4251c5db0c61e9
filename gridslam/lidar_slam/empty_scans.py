"""Scans of which no reading is usable: their number, and the lines that report them."""

from __future__ import annotations

import numpy as np

from gridslam.core.errors import MethodError
from gridslam.core.messages import LaserScan

MANY_EMPTY = 0.5  # fraction of empty scans from which a line reports them


class EmptyScans:
    """Counts the empty scans of a log."""

    def __init__(self) -> None:
        self.count = 0
        self._last: LaserScan | None = None

    def add(self, scan: LaserScan) -> None:
        """Add an empty scan."""
        self.count += 1
        self._last = scan

    def notes(self, scans: int) -> list[str]:
        """A line for the user, if many of all `scans` are empty."""
        if not self.count or self.count < MANY_EMPTY * scans:
            return []
        return [
            f"{self.count} of {scans} scans have no reading within their limits: check range_min, range_max, unit"
        ]

    def refuse_all_empty(self, scans: int) -> None:
        """Raises MethodError: all of one or more `scans` are empty, so that the path would be that of odometry."""
        if self._last is not None and self.count == scans:
            raise MethodError(
                f"none of the {scans} scans has a reading between range_min and range_max; "
                f"check these limits and the unit of the ranges ({_readings_in_words(self._last)})"
            )


def _readings_in_words(scan: LaserScan) -> str:
    """The readings of a scan of which none is usable, in words."""
    readings = scan.ranges_m[np.isfinite(scan.ranges_m)]
    if not len(readings):
        return "one holds no number; a point cloud has no return in the band of log.cloud then"
    return (
        f"one holds {float(readings.min()):.3g} to {float(readings.max()):.3g} m, and says {scan.range_min_m:.3g} to "
        f"{scan.range_max_m:.3g} m"
    )
