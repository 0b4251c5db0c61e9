"""Events without the faults that the check has found, in the order of their corrected stamps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Imu, LaserScan, Odometry, Transform
from gridslam.lidar_slam.sensor_checks.heading_errors import NO_ERRORS
from gridslam.lidar_slam.sensor_checks.odometry_correction import OdometryCorrection
from gridslam.lidar_slam.sensor_checks.own_body import LaterBodies
from gridslam.lidar_slam.sensor_checks.sensor_faults import SensorFaults
from gridslam.lidar_slam.sensor_checks.stamp_order import StampOrder

Floats = NDArray[np.float64]


class CorrectedEvents:
    """Corrects events. Those whose stamps are corrected wait for the events that now come before them.

    Parts of the robot that come into view later are added to the bodies in `faults`.
    """

    def __init__(self, faults: SensorFaults) -> None:
        self._faults = faults
        self._corrector = OdometryCorrector(faults.odometry)
        self._later_bodies = LaterBodies()
        # Corrected odometry, and other events that are later than the last scan
        self._early: deque[Event] = deque()
        late_s = [fault.lag_s for fault in faults.scans.lidars if fault.lag_s]
        self._ordered = StampOrder(round(max(0.0, *late_s) * 1e9)) if late_s else None

    def add(self, event: Event, rotation_rad: float) -> Iterator[Event]:
        """Process an event at which the robot has turned by `rotation_rad` in all; yields what need not wait any more."""
        recorded_ns = event.stamp_ns
        event = self._without_later_bodies(self._faults.scans.applied_to(event), rotation_rad)
        event = self._faults.extrinsics.applied_to(event)
        if self._faults.gyro is not None and isinstance(event, Imu):
            event = self._faults.gyro.applied_to(event)
        if self._ordered is None or isinstance(event, Transform):
            yield from self._released(event)
            return
        for earlier in self._ordered.add(event, recorded_ns):
            yield from self._released(earlier)

    def flush(self) -> Iterator[Event]:
        """The events that still wait."""
        if self._ordered is not None:
            for event in self._ordered.flush():
                yield from self._released(event)
        yield from self._early
        self._early.clear()

    def _released(self, event: Event) -> Iterator[Event]:
        """The event; odometry waits until events have reached its corrected stamp.

        If scans are late, all other events but transforms wait for them.
        """
        if not (self._faults.odometry.faults or self._faults.scans.late_scans_s):
            yield event
        elif isinstance(event, Odometry):
            self._early.append(self._corrector.corrected(event))
        elif self._faults.scans.late_scans_s and not isinstance(event, LaserScan):
            if isinstance(event, Transform):
                yield event
            else:
                self._early.append(event)
        else:
            while self._early and self._early[0].stamp_ns <= event.stamp_ns:
                yield self._early.popleft()
            yield event

    def _without_later_bodies(self, event: Event, rotation_rad: float) -> Event:
        """A scan without parts of the robot that came into view after the check; other events unchanged."""
        if not isinstance(event, LaserScan):
            return event
        body = self._later_bodies.found_in(event, rotation_rad)
        if body is None:
            return event
        self._faults.scans.own_bodies.append(body)
        return body.removed_from(event)


class OdometryCorrector:
    """Corrects the odometry of a log message by message; corrected messages have no velocities."""

    def __init__(self, correction: OdometryCorrection) -> None:
        self._correction = correction
        # Time (s) of the last odometry, and its pose `(3,)` with and without the errors of the heading
        self._last: tuple[float, Floats] | None = None
        self._pose = np.zeros(3)

    def corrected(self, odometry: Odometry) -> Odometry:
        """The next odometry of the log, corrected; the same object if there are no faults."""
        if not self._correction.faults:
            return odometry
        pose = self._correction.poses(odometry.pose)
        if self._correction.heading != NO_ERRORS and np.isfinite(pose).all():
            pose = self._with_corrected_rotation(odometry.stamp_ns * 1e-9, pose)
        x, y, yaw = pose.tolist()
        stamp_ns = odometry.stamp_ns - round(self._correction.lag_s * 1e9)
        nan = float("nan")
        return replace(odometry, stamp_ns=stamp_ns, x_m=x, y_m=y, yaw_rad=yaw, vx_mps=nan, wz_radps=nan)

    def _with_corrected_rotation(self, time_s: float, pose: Floats) -> Floats:
        """The pose `(3,)` after the next step, integrated with corrected rotations."""
        last_s, last = self._last or (time_s, pose)
        start, end = self._correction.heading.removed_from(
            np.array([last_s, max(time_s, last_s)]), np.array([last, pose])
        )
        self._pose = pose if self._last is None else se2.compose(self._pose, se2.between(start, end))
        self._last = time_s, pose
        return self._pose
