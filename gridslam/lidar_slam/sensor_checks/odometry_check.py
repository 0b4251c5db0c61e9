"""Holds back the first part of a log until odometry and scans are checked against each other, then passes all events on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event, Imu, LaserScan, Odometry
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of
from gridslam.lidar_slam.sensor_checks.corrected_events import CorrectedEvents
from gridslam.lidar_slam.sensor_checks.extrinsics_calibration import ExtrinsicsCheck, find_extrinsics
from gridslam.lidar_slam.sensor_checks.floor_line import find_floor_lines
from gridslam.lidar_slam.sensor_checks.gyro_calibration import (
    GyroCorrection,
    find_gyro_correction,
    is_gyro_with_scans,
    points_down,
)
from gridslam.lidar_slam.sensor_checks.level_check import LevelledScans
from gridslam.lidar_slam.sensor_checks.lidar_agreement import find_lidar_faults
from gridslam.lidar_slam.sensor_checks.odometry_calibration import (
    NO_STRETCHES,
    OdometryCorrection,
    calibrate,
    windows_of,
)
from gridslam.lidar_slam.sensor_checks.own_body import find_own_bodies, later_bodies_among
from gridslam.lidar_slam.sensor_checks.scan_angles import find_wrong_angles
from gridslam.lidar_slam.sensor_checks.scan_repairs import ScanRepairs
from gridslam.lidar_slam.sensor_checks.stale_scans import StaleScans
from gridslam.lidar_slam.sensor_checks.sweep_calibration import (
    find_sweep_time,
    stamped_at_end,
    stated_sweep_s,
)

Floats = NDArray[np.float64]

MIN_ROTATION_RAD, MIN_DISTANCE_M = 4.0, 6.0  # motion by odometry that is enough to judge it by
# Largest number of scans where the robot moves less, or no lag is certain; bounds memory and delay
MAX_SCANS = 600
STANDING_M, STANDING_RAD = 0.3, 0.3  # a robot that has moved less has not driven off yet, and shows nothing
MAX_STANDING_SCANS = 3000  # largest number of scans that are held until the robot moves


class OdometryCheck:
    """Passes on the events of a log; odometry, yaw rates and scans that contradict each other are corrected.

    `build_tracker` makes the tracker that follows the first scans without odometry. After `flush` all events are passed on at
    once.
    """

    def __init__(self, build_tracker: Callable[[], ScanTracker], stopwatch: Stopwatch) -> None:
        self._build_tracker = build_tracker
        self._stopwatch = stopwatch
        self._stale_scans = StaleScans()
        self._tracker: ScanTracker | None = build_tracker()
        self._held: list[Event] = []
        self._corrected: CorrectedEvents | None = None  # after the check
        self._tracked = 0  # of the held events
        self._scans = 0
        self._max_scans = MAX_SCANS
        self._next_check = 0  # smallest number of scans for the next check
        self._moved_m = self._turned_rad = 0.0
        self._last: Odometry | None = None
        self.correction = OdometryCorrection()
        self.gyro: GyroCorrection | None = None
        self.repairs = ScanRepairs()
        self._place = ExtrinsicsCheck()
        self.checked_scans = 0

    def process(self, event: Event) -> Iterator[Event]:
        """Take in an event; yields nothing until the check is done, and then all events but stale scans."""
        for fresh in self._stale_scans.process(event):
            yield from self._process(fresh)

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

    @property
    def _is_standing(self) -> bool:
        """Whether by odometry the robot has not driven off yet, and more scans of this may be held."""
        has_moved = self._moved_m >= STANDING_M or self._turned_rad >= STANDING_RAD
        return self._last is not None and not has_moved and self._scans < MAX_STANDING_SCANS

    def flush(self) -> Iterator[Event]:
        """The events that are still held back."""
        for event in self._stale_scans.flush():
            yield from self._process(event)
        if self._corrected is None:
            yield from self._check(is_last=True)
        if self._corrected is not None:
            yield from self._corrected.flush()

    @property
    def counters(self) -> Counter[str]:
        """The number of stale scans, which are left out."""
        return Counter({"skipped.scan.stale": self._stale_scans.count})

    def measures(self) -> dict[str, object]:
        """The corrections and the number of checked scans, for the report."""
        found, sweep = self.correction, self.repairs.sweep
        return {
            "checked_scans": self.checked_scans,
            "lag_s": round(found.lag_s, 3),
            "possible_lags_s": found.possible_lags_s and [round(lag, 3) for lag in found.possible_lags_s],
            "distance_scale": round(1.0 / found.scale, 3),
            "rotation_scale": round(1.0 / found.heading.scale, 3),
            "yaw_sign": -1 if found.mirrors_yaw else 1,
            "is_corrected": bool(found.faults),
            "sweep_s": None if sweep is None else round(sweep.sweep_s, 4),
            "late_scans_s": round(self.repairs.late_scans_s, 4),
        }

    def notes(self) -> list[str]:
        """One line that names the faults of the odometry, and one for each other fault and body in view; empty for a good log."""
        wrong = self.correction.notes
        if self.gyro is not None and self.gyro.is_fault:
            wrong.append(self.gyro.note)
        bodies = [body.note for body in self.repairs.own_bodies]
        return [*wrong, *self._place.notes, *self.repairs.notes, *self._stale_scans.notes, *bodies]

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the map for what the sensors say of each other; None without one."""
        return self.correction.doubt

    def _check(self, is_last: bool = False) -> Iterator[Event]:
        """Decide on the odometry and pass on the held events, or wait for more motion if that may allow a better decision."""
        with self._stopwatch.stage("odometry_check"):
            is_decided = self._decide(self._held, is_last)
        if not is_decided:
            self._next_check = 2 * self._scans
            return
        held, self._held, self._tracker = self._held, [], None
        self._corrected = CorrectedEvents(self.correction, self.gyro, self.repairs, self._place)
        for event in held:
            yield from self._corrected.add(event, self._turned_rad)

    def _decide(self, held: list[Event], is_last: bool) -> bool:
        """Find the faults of odometry and scans; False if more motion may allow a better decision."""
        odometry = [e for e in held if isinstance(e, Odometry) and e.is_finite]
        by_odometry = _trajectory(odometry)
        self._find_own_bodies(held)
        if not self._tracked:
            self.repairs.levels = LevelledScans.among(held).decided(held, self._build_tracker)
            repaired = [self.repairs.applied_to(e) for e in held]
            self.repairs.lidars = find_lidar_faults(repaired, by_odometry, self._build_tracker)
        if len(odometry) > 1 and self._scans > 1:
            self._find_wrong_angles(held, by_odometry)
            path = self._decide_sense(held, self._path(held), by_odometry)
            self.correction = self._calibrated(path, by_odometry)
            path = self._turned_over(held, path, by_odometry)
            windows = windows_of(path, by_odometry, self._open_ns())
            self._place = find_extrinsics(held, windows, self.correction)
        if self.correction.is_undecided and not is_last and self._scans < self._max_scans:
            return False
        if self._scans > 1:
            self._find_gyro(held)
            repaired = [self.repairs.applied_to(event) for event in held]
            self._path(held)
            if self._tracker is not None:
                self.repairs.sweep = find_sweep_time(repaired, self._tracker, self._build_tracker)
            self._find_late_scans(held, odometry)
        return True

    def _find_late_scans(self, held: list[Event], odometry: list[Odometry]) -> None:
        """Look whether the scans, and not the odometry, have the wrong stamps."""
        scans = [e for e in held if isinstance(e, LaserScan)]
        if len(odometry) < 2 or len(set(map(lidar_of, scans))) != 1:
            return
        if self.repairs.sweep is not None and self.correction.lag_s:
            self._restart_path()  # it was that of scans with other times
            again = self._calibrated(self._path(held), _trajectory(odometry))
            self.correction = replace(again, is_imu_with_scans=self.correction.is_imu_with_scans)
        applied = map(self.repairs.applied_to, scans)
        sweep_s = stated_sweep_s([scan for scan in applied if isinstance(scan, LaserScan)])
        if stamped_at_end(self.correction.lag_s, sweep_s):
            self.repairs.late_scans_s = sweep_s
            self.correction = replace(self.correction, lag_s=0.0)

    def _measure(self, odometry: Odometry) -> None:
        """Add the motion since the last odometry, in plain numbers: this is done for each message of a log."""
        if not odometry.is_finite:
            return
        last, self._last = self._last, odometry
        if last is not None:
            self._moved_m += math.hypot(odometry.x_m - last.x_m, odometry.y_m - last.y_m)
            self._turned_rad += abs(math.remainder(odometry.yaw_rad - last.yaw_rad, 2.0 * math.pi))

    def _decide_sense(self, held: list[Event], path: Trajectory, odometry: Trajectory) -> Trajectory:
        """The path; tracked anew, with the beams of ambiguous scans reversed, if the odometry rotates in the other direction."""
        is_uncertain = any(isinstance(e, LaserScan) and e.has_uncertain_sense for e in held)
        if (
            self.repairs.reverses_scans
            or not is_uncertain
            or not self._calibrated(path, odometry).mirrors_yaw
        ):
            return path
        self.repairs.reverses_scans = True
        self._restart_path()
        return self._path(held)

    def _turned_over(self, held: list[Event], path: Trajectory, odometry: Trajectory) -> Trajectory:
        """The path; tracked anew with mirrored scans if odometry and IMU both show that the only lidar hangs upside down."""
        if not self.correction.may_be_lidar or points_down(held):
            return path
        lidars = {lidar_of(e) for e in held if isinstance(e, LaserScan)}
        gyro = find_gyro_correction(held, path)
        if len(lidars) != 1 or gyro is None or not gyro.is_reversed:
            self.correction = replace(self.correction, is_imu_with_scans=is_gyro_with_scans(held, path))
            return path
        self.repairs.is_upside_down = True
        self._restart_path()
        path = self._path(held)
        self.correction = self._calibrated(path, odometry)
        return path

    def _find_gyro(self, held: list[Event]) -> None:
        """Find the correction of the yaw rates; the path is tracked anew if there is one."""
        if not any(isinstance(e, Imu) for e in held):
            return
        path = self._path(held)
        if self._tracker is not None and self._tracker.is_gyro_poor:
            self._restart_path()
            path = self._path([e for e in held if not isinstance(e, Imu)])
            self._restart_path()
        self.gyro = find_gyro_correction(held, path)
        if self.gyro is not None:
            self._restart_path()

    def _find_wrong_angles(self, held: list[Event], odometry: Trajectory) -> None:
        """Find lidars whose messages state wrong angles; the path begins anew where there are any."""
        if self.repairs.angles:
            return
        scans = [scan for e in held if isinstance(scan := self.repairs.applied_to(e), LaserScan)]
        self.repairs.angles = find_wrong_angles(scans, odometry, self._build_tracker)
        if self.repairs.angles:
            self._restart_path()

    def _find_own_bodies(self, held: list[Event]) -> None:
        """Look for what moves with a robot that turns, its body and lines of the floor: beside a straight drive a wall does."""
        scans = [e for e in held if isinstance(e, LaserScan)]
        bodies = find_own_bodies(scans)
        if bodies and not self._has_turned(held):
            bodies = []
        lines = find_floor_lines(scans, lambda: self._path_anew(held))
        if lines != self.repairs.floor_lines:
            self._restart_path()
        self.repairs.own_bodies, self.repairs.floor_lines = bodies, lines
        self.repairs.own_bodies += later_bodies_among(held, self.repairs.own_bodies)

    def _has_turned(self, held: list[Event]) -> bool:
        """Whether the robot has turned so far that only what moves with it stays in its view."""
        if self._turned_rad >= MIN_ROTATION_RAD:
            return True
        yaw = np.unwrap(self._path(held).poses[:, 2])
        return bool(np.abs(np.diff(yaw)).sum() >= MIN_ROTATION_RAD)

    def _path_anew(self, held: list[Event]) -> Trajectory:
        """The path over the held scans by a tracker of its own."""
        events = (self.repairs.applied_to(e) for e in held if not isinstance(e, Odometry))
        return self._build_tracker().track_all(events)

    def _calibrated(self, path: Trajectory, odometry: Trajectory) -> OdometryCorrection:
        """The faults of the odometry by the path of the tracker."""
        return calibrate(path, odometry, self._open_ns())

    def _open_ns(self) -> NDArray[np.int64]:
        """The stretches `(k, 2)` of the tracker's path on which the scans do not show how far the robot moved."""
        return NO_STRETCHES if self._tracker is None else self._tracker.path.open_ns()

    def _restart_path(self) -> None:
        """Forget the path: it must be tracked anew with other scans."""
        self._tracker, self._tracked = self._build_tracker(), 0

    def _path(self, held: list[Event]) -> Trajectory:
        """The path over the held scans by matching alone."""
        tracker = self._tracker
        if tracker is None:
            return Trajectory.empty()
        events = [self.repairs.applied_to(e) for e in held[self._tracked :] if not isinstance(e, Odometry)]
        if self.gyro is not None:
            events = [self.gyro.applied_to(e) if isinstance(e, Imu) else e for e in events]
        path = tracker.track_all(events)
        self._tracked, self.checked_scans = len(held), len(path)
        return path


def _trajectory(odometry: list[Odometry]) -> Trajectory:
    return Trajectory(
        np.array([o.stamp_ns for o in odometry], np.int64),
        np.array([o.pose for o in odometry]).reshape(-1, 3),
    )
