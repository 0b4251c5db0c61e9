"""Holds back the first part of a log until odometry and scans are checked against each other, then passes all events on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator

from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.core.stopwatch import Stopwatch
from gridslam.lidar_slam.scan_tracker import ScanTracker
from gridslam.lidar_slam.sensor_checks.corrected_events import CorrectedEvents
from gridslam.lidar_slam.sensor_checks.fault_search import MIN_ROTATION_RAD, FaultSearch
from gridslam.lidar_slam.sensor_checks.sensor_faults import SensorFaults
from gridslam.lidar_slam.sensor_checks.stale_scans import StaleScans

MIN_DISTANCE_M = 6.0  # distance by odometry that, with a rotation of MIN_ROTATION_RAD, is enough for a check
# Largest number of scans that are held if the robot moves less, or if no lag is certain; it bounds memory and delay
MAX_SCANS = 600
# A robot that has moved less still stands at its start, and shows nothing
STANDING_M, STANDING_RAD = 0.3, 0.3
MAX_STANDING_SCANS = 3000  # largest number of scans that are held until the robot moves


class OdometryCheck:
    """Passes on the events of a log; odometry, yaw rates and scans that contradict each other are corrected.

    `build_tracker` makes trackers that follow the first scans without odometry. After `flush`, events are passed on at once.
    """

    def __init__(self, build_tracker: Callable[[], ScanTracker], stopwatch: Stopwatch) -> None:
        self._stopwatch = stopwatch
        self._stale_scans = StaleScans()
        self.faults = SensorFaults()
        self.checked_scans = 0
        self._search: FaultSearch | None = FaultSearch(build_tracker, self.faults)  # until the check is done
        self._held: list[Event] = []
        self._scans = 0  # number of scans among the held events
        self._max_scans = MAX_SCANS
        self._next_check = 0  # smallest number of scans for the next check
        self._corrected: CorrectedEvents | None = None  # after the check
        self._moved_m = self._turned_rad = 0.0
        self._last: Odometry | None = None

    def process(self, event: Event) -> Iterator[Event]:
        """Process an event; yields nothing until the check is done, and then all events but stale scans."""
        for fresh in self._stale_scans.process(event):
            yield from self._process(fresh)

    def flush(self) -> Iterator[Event]:
        """The events that are still held back."""
        for event in self._stale_scans.flush():
            yield from self._process(event)
        yield from self._check(is_last=True)
        if self._corrected is not None:
            yield from self._corrected.flush()

    def _process(self, event: Event) -> Iterator[Event]:
        if isinstance(event, Odometry):
            self._measure(event)
        if self._corrected is not None:
            with self._stopwatch.stage("odometry_check"):
                corrected = list(self._corrected.add(event, self._turned_rad))
            yield from corrected
            return
        self._held.append(event)
        if isinstance(event, LaserScan):
            self._scans += 1
            has_moved = self._moved_m > MIN_DISTANCE_M and self._turned_rad > MIN_ROTATION_RAD
            if self._scans >= self._max_scans and self._is_standing:
                self._max_scans = self._scans + MAX_SCANS
            if self._scans >= self._max_scans or (has_moved and self._scans >= self._next_check):
                yield from self._check()

    def _check(self, is_last: bool = False) -> Iterator[Event]:
        """Finish the check and pass on the held events, or wait for more motion if that may allow a better decision."""
        if self._search is None:
            return
        may_wait = not is_last and self._scans < self._max_scans
        with self._stopwatch.stage("odometry_check"):
            is_decided = self._search.decide(self._held, self._turned_rad, may_wait)
        self.checked_scans = self._search.checked_scans
        if not is_decided:
            self._next_check = 2 * self._scans
            return
        held, self._held, self._search = self._held, [], None
        self._corrected = CorrectedEvents(self.faults)
        for event in held:
            yield from self._corrected.add(event, self._turned_rad)

    @property
    def _is_standing(self) -> bool:
        """Whether by odometry the robot still stands at its start, and more scans of this may be held."""
        has_moved = self._moved_m >= STANDING_M or self._turned_rad >= STANDING_RAD
        return self._last is not None and not has_moved and self._scans < MAX_STANDING_SCANS

    def _measure(self, odometry: Odometry) -> None:
        """Add the motion since the last odometry; with plain numbers, because every message of a log is measured."""
        if not odometry.is_finite:
            return
        last, self._last = self._last, odometry
        if last is not None:
            self._moved_m += math.hypot(odometry.x_m - last.x_m, odometry.y_m - last.y_m)
            self._turned_rad += abs(math.remainder(odometry.yaw_rad - last.yaw_rad, 2.0 * math.pi))

    @property
    def counters(self) -> Counter[str]:
        """The number of stale scans, which are left out."""
        return Counter({"skipped.scan.stale": self._stale_scans.count})

    def measures(self) -> dict[str, object]:
        """The corrections and the number of checked scans, for the report."""
        odometry, scans = self.faults.odometry, self.faults.scans
        lags_s = odometry.possible_lags_s
        return {
            "checked_scans": self.checked_scans,
            "lag_s": round(odometry.lag_s, 3),
            "possible_lags_s": lags_s and [round(lag, 3) for lag in lags_s],
            "distance_scale": round(1.0 / odometry.scale, 3),
            "rotation_scale": round(1.0 / odometry.heading.scale, 3),
            "yaw_sign": -1 if odometry.mirrors_yaw else 1,
            "is_corrected": bool(odometry.faults),
            "sweep_s": None if scans.sweep is None else round(scans.sweep.sweep_s, 4),
            "late_scans_s": round(scans.late_scans_s, 4),
        }

    def notes(self) -> list[str]:
        """One line for the user about each fault, and about each part of the robot in view; empty for a good log."""
        bodies = [body.note for body in self.faults.scans.own_bodies]
        return [*self.faults.notes, *self._stale_scans.notes, *bodies]

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the map because the sensors contradict each other; None without one."""
        return self.faults.odometry.doubt
