"""Holds back the first part of a log until its odometry is checked against its scans, then gives all events on."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.odometry_calibration import OdometryCorrection, calibrate
from gridslam.lidar_slam.scan_tracker import ScanTracker

Floats = NDArray[np.float64]

MIN_ROTATION_RAD, MIN_DISTANCE_M = 4.0, 6.0  # by odometry: enough motion to judge it by
MAX_SCANS = 600  # where the robot moves less; bounds memory and delay


class OdometryCheck:
    """Gives on the events of a log, with odometry corrected where it is found to be wrong; good odometry stays as it is.

    `build_tracker` makes the tracker that follows the first scans without odometry.
    """

    def __init__(self, build_tracker: Callable[[], ScanTracker]) -> None:
        self._build_tracker = build_tracker
        self._held: list[Event] | None = []
        self._scans = 0
        self._moved = np.zeros(2)  # m, rad
        self._last: Odometry | None = None
        self._early: deque[Odometry] = deque()  # corrected odometry later than the last event
        self.correction = OdometryCorrection()
        self.checked_scans = 0

    def process(self, event: Event) -> Iterator[Event]:
        """Take in an event; yields nothing until the check is done, and then all events."""
        if self._held is None:
            yield from self._give(event)
            return
        self._held.append(event)
        if isinstance(event, Odometry):
            self._measure(event)
        elif isinstance(event, LaserScan):
            self._scans += 1
            has_moved = self._moved[0] > MIN_DISTANCE_M and self._moved[1] > MIN_ROTATION_RAD
            if has_moved or self._scans >= MAX_SCANS:
                yield from self._check()

    def flush(self) -> Iterator[Event]:
        """The events that are still held back."""
        if self._held is not None:
            yield from self._check()
        yield from self._early
        self._early.clear()

    def measures(self) -> dict[str, object]:
        """What was found, for the report."""
        found = self.correction
        return {
            "checked_scans": self.checked_scans,
            "lag_s": round(found.lag_s, 3),
            "distance_scale": round(1.0 / found.scale, 3),
            "yaw_sign": -1 if found.mirrors_yaw else 1,
            "is_corrected": bool(found.faults),
        }

    def notes(self) -> list[str]:
        """One line that names the faults; empty for good odometry."""
        faults = self.correction.faults
        return [f"odometry contradicts the scans: {', '.join(faults)}; used corrected"] if faults else []

    def _check(self) -> Iterator[Event]:
        held, self._held = self._held or [], None
        odometry = [e for e in held if isinstance(e, Odometry) and np.isfinite(e.pose).all()]
        if len(odometry) > 1 and self._scans > 1:
            self.correction = calibrate(self._tracked(held), _trajectory(odometry))
        for event in held:
            yield from self._give(event)

    def _give(self, event: Event) -> Iterator[Event]:
        """The event with corrections; odometry waits until events have reached its corrected stamp."""
        if not self.correction.faults:
            yield event
        elif isinstance(event, Odometry):
            self._early.append(self.correction.corrected(event))
        else:
            while self._early and self._early[0].stamp_ns <= event.stamp_ns:
                yield self._early.popleft()
            yield event

    def _measure(self, odometry: Odometry) -> None:
        if self._last is not None and np.isfinite(odometry.pose).all():
            step = se2.between(self._last.pose, odometry.pose)
            self._moved += (np.hypot(step[0], step[1]), abs(step[2]))
        if np.isfinite(odometry.pose).all():
            self._last = odometry

    def _tracked(self, held: list[Event]) -> Trajectory:
        """The path over the held scans by matching alone."""
        tracker = self._build_tracker()
        for event in held:
            if not isinstance(event, Odometry):
                for placed in tracker.process(event):
                    tracker.track_scan(placed)
        for placed in tracker.flush():
            tracker.track_scan(placed)
        self.checked_scans = len(tracker.stamps_ns)
        return Trajectory(np.array(tracker.stamps_ns, np.int64), np.array(tracker.track_poses).reshape(-1, 3))


def _trajectory(odometry: list[Odometry]) -> Trajectory:
    return Trajectory(
        np.array([o.stamp_ns for o in odometry], np.int64), np.array([o.pose for o in odometry])
    )
