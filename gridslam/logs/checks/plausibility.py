"""Contradictions within the scans of a stream: all are reported, those with a certain remedy are repaired."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np

from gridslam.core.messages import LaserScan, as_float32, readonly
from gridslam.core.stamps import NS_PER_S
from gridslam.logs.checks.no_return_codes import NoReturnCodes
from gridslam.logs.checks.scan_units import in_metres, in_radians, range_unit
from gridslam.logs.message_counts import MessageCounts

CODE_FRACTION = 0.97  # a reading this near to range_max that comes again and again is a code for no return
CODE_BEAMS = 5  # a code is the largest reading of a scan, on at least this many beams
MAX_SWEEP_PERIODS = 1.1  # a sweep that lasts longer would overlap the next
MIN_STAMPS = 3  # fewer give no period
MIN_DIFFERENT = 8  # number of the first scans that differ, which shows how often each was recorded


class ScanPlausibility:
    """Repairs the scans of one stream; each kind of repair is counted as `repaired.scan.<what>` and noted once.

    `stamps_ns` are those of the stream, `label` its name in messages to the user. `sweep_s` is the duration of a sweep, for scans
    that do not state it. `first` are the first scans; they show the unit of the readings and the code for no return.
    """

    def __init__(
        self,
        stamps_ns: Sequence[int],
        label: str,
        message_counts: MessageCounts,
        sweep_s: float | None = None,
        first: Sequence[LaserScan] = (),
    ) -> None:
        self._label = label
        self._message_counts = message_counts
        self._sweep_s = sweep_s
        self._unit = range_unit(first)
        self._codes = NoReturnCodes(map(self._in_metres, first))
        steps = np.diff(np.asarray(stamps_ns, np.int64))
        steps = steps[steps > 0]
        copies = _copies_of_each(first)
        period_ns = float(steps.mean()) * copies if copies > 1 else float(median(steps.tolist() or [0]))
        self._period_s = period_ns / NS_PER_S if len(steps) >= MIN_STAMPS else math.inf

    def repaired(self, scan: LaserScan) -> LaserScan:
        """The scan with its contradictions removed; the same object where it has none."""
        scan = self._angles(self._in_radians(scan))
        scan = self._range_limit(self._in_metres(scan))
        return self._no_return_code(self._timed(self._sweep(scan)))

    def _in_radians(self, scan: LaserScan) -> LaserScan:
        """The scan with angles in radians; angles that can only be degrees are converted."""
        found = in_radians(scan)
        if found is not scan:
            self._note(
                "degrees",
                f"angle_increment {scan.angle_increment_rad:.6g} is in degrees, not radians: converted",
            )
        return found

    def _in_metres(self, scan: LaserScan) -> LaserScan:
        """The scan with readings in metres, converted from the unit that its stream uses."""
        if self._unit is None:
            return scan
        name, per_metre = self._unit
        self._note("range_unit", f"ranges are in {name}, not in m: divided by {per_metre:g}")
        return in_metres(scan, per_metre)

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
            scan,
            angle_increment_rad=as_float32(expected),
            has_uncertain_sense=increment * expected < 0.0,
            other_increment_rad=increment,
        )

    def _range_limit(self, scan: LaserScan) -> LaserScan:
        """The scan with valid range limits: a range_max of 0, less or NaN becomes infinite, exchanged limits are swapped."""
        lower, upper = scan.range_min_m, scan.range_max_m
        if not upper > 0.0:
            self._note("range_max", f"range_max is {upper:g}: taken as not stated")
            return replace(scan, range_max_m=math.inf, range_min_m=max(0.0, lower))
        if lower > upper:
            self._note("range_limits", f"range_min {lower:g} is above range_max {upper:g}: exchanged")
            return replace(scan, range_min_m=upper, range_max_m=lower)
        return scan

    def _sweep(self, scan: LaserScan) -> LaserScan:
        """The scan, without its time_increment if a sweep would last longer than the time between two scans."""
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
        """The scan, with the sweep time of the config if it states no times."""
        if self._sweep_s is None or scan.time_increment_s != 0.0 or len(scan.ranges_m) < 2:
            return scan
        return replace(scan, time_increment_s=as_float32(self._sweep_s / (len(scan.ranges_m) - 1)))

    def _no_return_code(self, scan: LaserScan) -> LaserScan:
        """The scan with infinity in place of the value that its driver writes for no return."""
        limit, ranges = scan.range_max_m, scan.ranges_m
        if not len(ranges):
            return scan
        inside = ranges[ranges < limit]
        largest = inside.max() if len(inside) else np.float32(0.0)
        is_near_limit = math.isfinite(limit) and largest >= CODE_FRACTION * limit
        self._codes.add(ranges, limit)
        if is_near_limit and np.count_nonzero(ranges == largest) >= CODE_BEAMS:
            code, where = float(largest), f", just below range_max {limit:.6g}"
        elif self._codes.known is not None and (ranges == self._codes.known).any():
            code, where = self._codes.known, " in scan after scan, far beyond all others"
        else:
            return scan
        self._note(
            "no_return_code",
            f"{CODE_BEAMS} beams and more read exactly {code:.6g} m{where}: taken as no return",
        )
        return replace(
            scan, ranges_m=readonly(np.where(ranges == np.float32(code), np.inf, ranges), np.float32)
        )

    def _note(self, what: str, line: str) -> None:
        if not self._message_counts.counters[f"repaired.scan.{what}"]:
            self._message_counts.find(f"{self._label}: {line}")
        self._message_counts.count(f"repaired.scan.{what}")


def _copies_of_each(scans: Sequence[LaserScan]) -> int:
    """The number of scans in a row that have the same readings, where a relay gives each again; 1 where few differ."""
    readings = [scan.ranges_m.tobytes() for scan in scans]
    different = [0, *(k for k in range(1, len(scans)) if readings[k] != readings[k - 1])]
    return round(median(np.diff(different).tolist())) if len(different) >= MIN_DIFFERENT else 1
