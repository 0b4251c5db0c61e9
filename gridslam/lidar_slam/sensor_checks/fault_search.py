"""Finds the faults of the sensors in the first part of a log, by the path that scan matching alone gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gridslam.core.messages import Event, Imu, LaserScan, Odometry
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of
from gridslam.lidar_slam.sensor_checks.extrinsics_calibration import find_extrinsics
from gridslam.lidar_slam.sensor_checks.floor_line import find_floor_lines
from gridslam.lidar_slam.sensor_checks.gyro_calibration import (
    find_gyro_correction,
    is_gyro_with_scans,
    points_down,
)
from gridslam.lidar_slam.sensor_checks.level_check import LevelledScans
from gridslam.lidar_slam.sensor_checks.lidar_agreement import find_lidar_faults
from gridslam.lidar_slam.sensor_checks.motion_windows import MotionWindows, windows_of
from gridslam.lidar_slam.sensor_checks.odometry_calibration import calibrate
from gridslam.lidar_slam.sensor_checks.own_body import find_own_bodies, later_bodies_among
from gridslam.lidar_slam.sensor_checks.scan_angles import find_wrong_angles
from gridslam.lidar_slam.sensor_checks.sensor_faults import SensorFaults
from gridslam.lidar_slam.sensor_checks.sweep_calibration import (
    find_sweep_time,
    stamped_at_end,
    stated_sweep_s,
)

MIN_ROTATION_RAD = 4.0  # rotation after which only what moves with the robot is still in the same direction


class FaultSearch:
    """Enters the faults that it finds in `faults`. `checked_scans` is the number of scans that were tracked for it.

    `build_tracker` makes a tracker; the search gives it no odometry. The path is kept from one decision to the next, and tracked
    again whenever a new repair changes the scans.
    """

    def __init__(self, build_tracker: Callable[[], ScanTracker], faults: SensorFaults) -> None:
        self.faults = faults
        self.checked_scans = 0
        self._build_tracker = build_tracker
        self._tracker = build_tracker()
        self._tracked = 0  # number of events that the tracker has processed
        self._events: list[Event] = []
        self._turned_rad = 0.0

    def decide(self, events: list[Event], turned_rad: float, may_wait: bool) -> bool:
        """Find the faults by the events so far; False if `may_wait`, and more motion may allow a better decision.

        Earlier calls had the first of these events. `turned_rad` is the sum of all rotations by odometry.
        """
        self._events, self._turned_rad = events, turned_rad
        repairs = self.faults.scans
        scans = sum(isinstance(event, LaserScan) for event in events)
        odometry = _trajectory([e for e in events if isinstance(e, Odometry) and e.is_finite])
        self._find_own_bodies()
        if not self._tracked:
            repairs.levels = LevelledScans.among(events).decided(events, self._build_tracker)
            repaired = [repairs.applied_to(event) for event in events]
            repairs.lidars = find_lidar_faults(repaired, odometry, self._build_tracker)
        if len(odometry) > 1 and scans > 1:
            self._find_odometry_faults(odometry)
        if may_wait and self.faults.odometry.is_undecided:
            return False
        if scans > 1:
            self._find_gyro_faults()
            repaired = [repairs.applied_to(event) for event in events]
            self._path()
            repairs.sweep = find_sweep_time(repaired, self._tracker, self._build_tracker)
            self._find_late_scans(odometry)
        return True

    def _find_odometry_faults(self, odometry: Trajectory) -> None:
        """Compare the path with the odometry; scans that are wrong themselves are repaired before."""
        self._find_wrong_angles(odometry)
        self._find_sense(odometry)
        self.faults.odometry = calibrate(self._windows(odometry))
        self._find_upside_down(odometry)
        self.faults.extrinsics = find_extrinsics(self._events, self._windows(odometry), self.faults.odometry)

    def _find_wrong_angles(self, odometry: Trajectory) -> None:
        """Find lidars whose messages state wrong angles."""
        repairs = self.faults.scans
        if repairs.angles:
            return
        scans = [scan for e in self._events if isinstance(scan := repairs.applied_to(e), LaserScan)]
        repairs.angles = find_wrong_angles(scans, odometry, self._build_tracker)
        if repairs.angles:
            self._restart_path()

    def _find_sense(self, odometry: Trajectory) -> None:
        """Reverse the beams of scans that contradict themselves about their sense, if the path rotates against the odometry."""
        is_uncertain = any(isinstance(e, LaserScan) and e.has_uncertain_sense for e in self._events)
        if self.faults.scans.reverses_scans or not is_uncertain:
            return
        if calibrate(self._windows(odometry)).mirrors_yaw:
            self.faults.scans.reverses_scans = True
            self._restart_path()

    def _find_upside_down(self, odometry: Trajectory) -> None:
        """Mirror the scans if odometry and IMU both show that the only lidar hangs upside down."""
        if not self.faults.odometry.may_be_lidar or points_down(self._events):
            return
        gyro = find_gyro_correction(self._events, self._path())
        if self._has_one_lidar and gyro is not None and gyro.is_reversed:
            self.faults.scans.is_upside_down = True
            self._restart_path()
            self.faults.odometry = calibrate(self._windows(odometry))
        else:
            is_with_scans = is_gyro_with_scans(self._events, self._path())
            self.faults.odometry = replace(self.faults.odometry, is_imu_with_scans=is_with_scans)

    def _find_gyro_faults(self) -> None:
        """Find the correction of the yaw rates."""
        if not any(isinstance(e, Imu) for e in self._events):
            return
        path = self._path()
        if self._tracker.is_gyro_poor:
            self._restart_path()
            path = self._tracker_path([e for e in self._events if not isinstance(e, Imu)])
            self._restart_path()
        self.faults.gyro = find_gyro_correction(self._events, path)
        if self.faults.gyro is not None:
            self._restart_path()

    def _find_late_scans(self, odometry: Trajectory) -> None:
        """Check whether the scans, and not the odometry, have the wrong stamps."""
        if len(odometry) < 2 or not self._has_one_lidar:
            return
        faults, repairs = self.faults, self.faults.scans
        if repairs.sweep is not None and faults.odometry.lag_s:
            self._restart_path()  # the times of the beams have changed
            again = calibrate(self._windows(odometry))
            faults.odometry = replace(again, is_imu_with_scans=faults.odometry.is_imu_with_scans)
        scans = [scan for e in self._events if isinstance(scan := repairs.applied_to(e), LaserScan)]
        sweep_s = stated_sweep_s(scans)
        if stamped_at_end(faults.odometry.lag_s, sweep_s):
            repairs.late_scans_s = sweep_s
            faults.odometry = replace(faults.odometry, lag_s=0.0)

    def _find_own_bodies(self) -> None:
        """Find what moves with a robot that turns: its body, and lines of the floor. On a straight drive, walls do so as well."""
        repairs = self.faults.scans
        scans = [e for e in self._events if isinstance(e, LaserScan)]
        bodies = find_own_bodies(scans)
        if bodies and not self._has_turned:
            bodies = []
        lines = find_floor_lines(scans, self._path_of_new_tracker)
        if lines != repairs.floor_lines:
            self._restart_path()
        repairs.own_bodies, repairs.floor_lines = bodies, lines
        repairs.own_bodies += later_bodies_among(self._events, repairs.own_bodies)

    @property
    def _has_turned(self) -> bool:
        """Whether the robot has turned so far that only what moves with it stays in its view."""
        if self._turned_rad >= MIN_ROTATION_RAD:
            return True
        yaw = np.unwrap(self._path().poses[:, 2])
        return bool(np.abs(np.diff(yaw)).sum() >= MIN_ROTATION_RAD)

    @property
    def _has_one_lidar(self) -> bool:
        return len({lidar_of(e) for e in self._events if isinstance(e, LaserScan)}) == 1

    def _windows(self, odometry: Trajectory) -> MotionWindows | None:
        """Motions of the path and of the odometry; None if matching alone jumps, as between scans a metre or a turn apart."""
        path = self._path()
        return None if self._tracker.is_erratic else windows_of(path, odometry, self._tracker.path.open_ns())

    def _path(self) -> Trajectory:
        """The path over all scans so far, with the repairs so far."""
        return self._tracker_path(self._events)

    def _tracker_path(self, events: list[Event]) -> Trajectory:
        """The path over the scans among events, of which the tracker has processed the first."""
        repairs, gyro = self.faults.scans, self.faults.gyro
        new = [repairs.applied_to(e) for e in events[self._tracked :] if not isinstance(e, Odometry)]
        if gyro is not None:
            new = [gyro.applied_to(e) if isinstance(e, Imu) else e for e in new]
        path = self._tracker.track_all(new)
        self._tracked, self.checked_scans = len(events), len(path)
        return path

    def _path_of_new_tracker(self) -> Trajectory:
        """The path over all scans so far by another tracker."""
        repaired = (self.faults.scans.applied_to(e) for e in self._events if not isinstance(e, Odometry))
        return self._build_tracker().track_all(repaired)

    def _restart_path(self) -> None:
        """Forget the path, because the repairs have changed the scans."""
        self._tracker, self._tracked = self._build_tracker(), 0


def _trajectory(odometry: list[Odometry]) -> Trajectory:
    """The poses of odometry messages."""
    return Trajectory(
        np.array([o.stamp_ns for o in odometry], np.int64),
        np.array([o.pose for o in odometry]).reshape(-1, 3),
    )
