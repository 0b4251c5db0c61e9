"""What contradicts itself in the scans of a stream: repaired where that is certain, told in any case."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from gridslam.core.messages import LaserScan, as_float32, readonly
from gridslam.core.stamps import NS_PER_S
from gridslam.logs.message_counts import MessageCounts

CODE_FRACTION = 0.97  # a reading this near to range_max that comes again and again is a code for no return
CODE_BEAMS = 5  # a code is the largest reading of a scan, on at least this many beams
MAX_SWEEP_PERIODS = 1.1  # a sweep that lasts longer would overlap the next
MIN_STAMPS = 3  # fewer give no period


class ScanPlausibility:
    """Repairs the scans of one stream; each kind of repair is counted as `repaired.scan.<what>` and noted once.

    `stamps_ns` are those of the stream, `label` its name for people. `sweep_s` is the time of a sweep for scans that say none.
    """

    def __init__(
        self,
        stamps_ns: Sequence[int],
        label: str,
        message_counts: MessageCounts,
        sweep_s: float | None = None,
    ) -> None:
        self._sweep_s = sweep_s
        self._label = label
        self._message_counts = message_counts
        steps = np.diff(np.asarray(stamps_ns, np.int64))
        steps = steps[steps > 0]
        self._period_s = float(median(steps.tolist())) / NS_PER_S if len(steps) >= MIN_STAMPS else math.inf

    def repaired(self, scan: LaserScan) -> LaserScan:
        """The scan with its contradictions removed; the same object where it has none."""
        return self._no_return_code(self._timed(self._sweep(self._range_limit(self._angles(scan)))))

    def _angles(self, scan: LaserScan) -> LaserScan:
        """Angles by angle_min, angle_max and the count of beams, where the increment contradicts them."""
        count = len(scan.ranges_m)
        span = scan.angle_max_rad - scan.angle_min_rad
        if count < 2 or not math.isfinite(span) or span == 0.0:
            return scan
        increment = scan.angle_increment_rad
        expected = span / (count - 1)
        # Drivers differ by a beam in what they call the last angle.
        if abs(increment * (count - 1) - span) <= 1.6 * abs(expected):
            return scan
        if abs(span) > 2.0 * math.pi * 1.01:
            return scan
        self._note(
            "angles",
            f"angle_increment {increment:.6g} contradicts angle_min, angle_max and {count} beams: "
            f"{expected:.6g} is used",
        )
        return replace(
            scan, angle_increment_rad=as_float32(expected), has_uncertain_sense=increment * expected < 0.0
        )

    def _range_limit(self, scan: LaserScan) -> LaserScan:
        """A range_max of 0 states nothing."""
        if scan.range_max_m != 0.0:
            return scan
        self._note("range_max", "range_max is 0: taken as not stated")
        return replace(scan, range_max_m=math.inf)

    def _sweep(self, scan: LaserScan) -> LaserScan:
        """A sweep cannot last longer than the time between two scans."""
        sweep_s = abs(scan.time_increment_s) * max(len(scan.ranges_m) - 1, 0)
        if sweep_s <= MAX_SWEEP_PERIODS * self._period_s:
            return scan
        self._note(
            "time_increment",
            f"time_increment makes a sweep of {sweep_s:.3g} s, and scans come every {self._period_s:.3g} s: "
            "it is not used, so motion within a scan is not undone unless log.sweep_s gives the time",
        )
        return replace(scan, time_increment_s=0.0)

    def _timed(self, scan: LaserScan) -> LaserScan:
        """A scan without times gets those of the config."""
        if self._sweep_s is None or scan.time_increment_s != 0.0 or len(scan.ranges_m) < 2:
            return scan
        return replace(scan, time_increment_s=as_float32(self._sweep_s / (len(scan.ranges_m) - 1)))

    def _no_return_code(self, scan: LaserScan) -> LaserScan:
        """The value below range_max that a driver writes for no return becomes infinite."""
        limit = scan.range_max_m
        ranges = scan.ranges_m
        if not math.isfinite(limit) or not len(ranges):
            return scan
        inside = ranges[ranges < limit]
        largest = inside.max() if len(inside) else np.float32(0.0)
        if not largest >= CODE_FRACTION * limit or np.count_nonzero(ranges == largest) < CODE_BEAMS:
            return scan
        self._note(
            "no_return_code",
            f"{CODE_BEAMS} beams and more read exactly {float(largest):.6g} m, just below range_max "
            f"{limit:.6g}: taken as no return",
        )
        return replace(scan, ranges_m=readonly(np.where(ranges == largest, np.inf, ranges), np.float32))

    def _note(self, what: str, line: str) -> None:
        if not self._message_counts.counters[f"repaired.scan.{what}"]:
            self._message_counts.note(f"{self._label}: {line}")
        self._message_counts.count(f"repaired.scan.{what}")
