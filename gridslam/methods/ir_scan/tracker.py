"""From events to stops, in mapping and in localization: motion, absolute poses and sweeps."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.core.messages import AbsolutePose, Event, Imu, Odometry, Range, Transform, WheelTicks
from gridslam.methods.ir_scan.config import IrScanConfig
from gridslam.methods.ir_scan.stops import MeasuredPose, Stop, StopMatch
from gridslam.motion.wheel_gyro import MotionLimits, RelativeMotion, WheelGyro, WheelGyroNoise
from gridslam.sensors.infrared import InfraredScan, reliability, reliable_readings
from gridslam.sensors.infrared_sweeps import CompleteScan, SweepAssembler, SweepLimits
from gridslam.sensors.lidar_beams import extrinsics_of

Floats = NDArray[np.float64]

# Squared Mahalanobis distance from which on an absolute pose is an outlier: the 99 % point of chi-square with 3 degrees of
# freedom
GATE = 11.34


class StopTracker:
    """Follows the robot from stop to stop. `stops[0]` is the start; every complete scan adds a stop."""

    def __init__(self, config: IrScanConfig, start_covariance: Floats) -> None:
        self._config = config
        self._motion = _motion_of(config)
        self._limits = SweepLimits()
        self._sweeps = SweepAssembler(self._limits)
        start = np.array(config.start if config.start is not None else (0.0, 0.0, 0.0))
        self.stops = [Stop(0, start, start_covariance, start, None)]
        self._has_map_frame = config.start is not None  # else the first absolute pose defines it
        self._last_absolute: MeasuredPose | None = None  # used only without odometry
        self.counters: Counter[str] = Counter()
        self._handlers: dict[type[Event], Callable[[Any], Stop | None]] = {
            Range: self._add_range,
            Odometry: self._add_odometry,
            WheelTicks: self._add_wheels,
            AbsolutePose: self._add_absolute_pose,
            Transform: self._add_transform,
        }
        if config.motion.use_gyro:
            self._handlers[Imu] = self._motion.add_imu

    def motion_since_stop(self) -> RelativeMotion:
        """The motion by odometry since the last stop."""
        return self._motion.motion()

    def add(self, event: Event) -> Stop | None:
        """Add an event; returns the stop whose scan it completes, if any, which is to be passed to `apply_match`."""
        handler = self._handlers.get(type(event))
        return None if handler is None else handler(event)

    def _add_range(self, event: Range) -> Stop | None:
        motion = self._motion
        complete = self._sweeps.add(event, motion.total_rows, motion.travelled_m, motion.rotated_rad)
        return None if complete is None else self._add_stop(complete)

    def _add_odometry(self, event: Odometry) -> Stop | None:
        self._motion.add_odometry(event)
        return self._check_departure()

    def _add_wheels(self, event: WheelTicks) -> Stop | None:
        self._motion.add_wheels(event)
        return self._check_departure()

    def _check_departure(self) -> Stop | None:
        """The stop that the robot has just left, if any."""
        complete = self._sweeps.move(self._motion.travelled_m, self._motion.rotated_rad)
        return None if complete is None else self._add_stop(complete)

    def _add_transform(self, event: Transform) -> None:
        if event.is_static:
            self._sweeps.sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)

    def finish(self) -> Stop | None:
        """The stop of the scan that is still open at the end of the log."""
        self._motion.flush()
        complete = self._sweeps.flush()
        return None if complete is None else self._add_stop(complete)

    def apply_match(self, stop: Stop, match: StopMatch) -> None:
        """Correct a stop by the match of its scan."""
        stop.pose, stop.covariance = match.pose, match.covariance
        stop.pose[2] = float(se2.wrap_angle(stop.pose[2]))
        stop.verdict, stop.score = match.verdict, match.score
        self.counters[f"scan.{match.verdict}"] += 1

    def advance_to_end(self) -> None:
        """Run the odometry to the end of the log."""
        self._motion.advance_to(self._motion.total_rows)

    def all_counters(self) -> Counter[str]:
        """The counters of motion, sweeps and readings."""
        return self.counters + self._motion.counters + self._sweeps.counters

    def _add_stop(self, complete: CompleteScan) -> Stop:
        self._require_motion()
        odometry, last = self._motion, self.stops[-1]
        odometry.advance_to(complete.mark)
        motion = odometry.stop()
        pose, covariance = se2.compound(last.pose, last.covariance, motion.T_stop_now, motion.covariance)
        absolute_poses = []
        if not odometry.is_known and self._last_absolute is not None:
            measured = self._last_absolute
            pose, covariance, absolute_poses = measured.pose.copy(), measured.covariance, [measured]
        stop = Stop(
            complete.scan.stamp_ns, pose, covariance, pose.copy(), motion, absolute_poses=absolute_poses
        )
        stop.has_odometry = odometry.is_known
        self._select_readings(stop, complete.scan)
        self.stops.append(stop)
        return stop

    def _select_readings(self, stop: Stop, scan: InfraredScan) -> None:
        """Give the stop its scan and the reliable readings of it, and count the others."""
        scan = self._with_limits(scan)
        readings = reliable_readings(scan, reliability(scan, self._config.readings.neighbour_m))
        valid = int(scan.is_valid().sum())
        self.counters["used.range"] += len(readings)
        self.counters["skipped.range.out_of_limits"] += len(scan) - valid
        self.counters["skipped.range.unreliable"] += valid - len(readings)
        self.counters["scan.all_invalid"] += valid == 0
        self.counters["scans"] += 1
        stop.scan, stop.readings = scan, readings

    def _with_limits(self, scan: InfraredScan) -> InfraredScan:
        """The scan with the valid ranges of the config."""
        low, high = scan.range_min_m.copy(), scan.range_max_m.copy()
        for k, name in enumerate(scan.names):
            if (limits := self._config.readings.limits.get(name)) is not None:
                low[scan.sensor == k], high[scan.sensor == k] = limits.min_m, limits.max_m
        return replace(scan, range_min_m=low, range_max_m=high)

    def _require_motion(self) -> None:
        """Raise MethodError if the motion of the robot is unknown: the map would be wrong."""
        if self._motion.is_known or self._last_absolute is not None:
            return
        if self._motion.counters["unused.wheels"]:
            raise MethodError(
                "the log has wheel angles but no odometry: set method.motion.wheel_radius_m and wheel_base_m"
            )
        if len(self.stops) > 1 or self._config.start is None:
            raise MethodError(
                "no odometry, wheel angles or absolute poses before the first readings: the robot's pose is unknown; "
                "choose these streams under log.topics"
            )

    def _add_absolute_pose(self, event: AbsolutePose) -> Stop | None:
        """Correct the last stop by an absolute pose and the motion since then; without odometry, move the robot to that pose."""
        if not (np.isfinite(event.pose).all() and np.isfinite(event.covariance).all()):
            self.counters["skipped.pose.not_finite"] += 1
            return None
        measured = MeasuredPose(np.array(event.pose), np.array(event.covariance))
        if not self._motion.is_known:
            return self._move_to(measured)
        self._motion.advance_to(self._motion.total_rows)
        since, last = self._motion.motion(), self.stops[-1]
        step = MeasuredPose(since.T_stop_now, since.covariance)
        if not self._has_map_frame:
            if len(self.stops) > 1:
                self.counters["skipped.pose.after_first_scan"] += 1
                return None
            last.pose = se2.compose(measured.pose, se2.inverse(step.pose))
            last.covariance = measured.covariance + step.covariance
            self._has_map_frame = True
            self.counters["used.pose"] += 1
            return None
        self._correct(last, step, measured)
        return None

    def _correct(self, last: Stop, step: MeasuredPose, measured: MeasuredPose) -> None:
        """Kalman update of the last stop by an absolute pose, unless that is an outlier; `step` is the motion since the stop."""
        predicted, covariance = se2.compound(last.pose, last.covariance, step.pose, step.covariance)
        innovation = measured.pose - predicted
        innovation[2] = float(se2.wrap_angle(innovation[2]))
        S = covariance + measured.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > GATE:
            self.counters["skipped.pose.outlier"] += 1
            return
        F = se2.turning_jacobian(se2.compose([0.0, 0.0, last.pose[2]], step.pose)[:2])
        gain = last.covariance @ F.T @ np.linalg.inv(S)
        last.pose = last.pose + gain @ innovation
        last.covariance = last.covariance - gain @ F @ last.covariance
        F_inverse = np.linalg.inv(F)
        last.absolute_poses.append(
            MeasuredPose(
                se2.compose(measured.pose, se2.inverse(step.pose)),
                F_inverse @ (measured.covariance + step.covariance) @ F_inverse.T,
            )
        )
        self.counters["used.pose"] += 1

    def _move_to(self, measured: MeasuredPose) -> Stop | None:
        """Without odometry: an absolute pose away from the last one ends the open scan, and the next scan is taken there.

        Returns the stop of the scan that has ended, if any.
        """
        self.counters["used.pose"] += 1
        last, completed = self._last_absolute, None
        if last is not None:
            distance = np.abs(se2.between(last.pose, measured.pose))
            limits = self._limits
            if (
                max(distance[0], distance[1]) <= limits.max_travel_m
                and distance[2] <= limits.max_rotation_rad
            ):
                return None
        complete = self._sweeps.flush()
        if complete is not None:
            completed = self._add_stop(complete)
        self._last_absolute = measured
        return completed


def _motion_of(config: IrScanConfig) -> WheelGyro:
    motion, noise = config.motion, config.advanced.motion
    return WheelGyro(
        WheelGyroNoise(
            forward_per_root_m=noise.forward_std_m,
            lateral_per_root_m=noise.lateral_std_m,
            yaw_per_root_m=noise.yaw_std_per_m_rad,
            yaw_per_root_rad=noise.yaw_std_per_rad_rad,
            gyro_per_root_s=noise.gyro_std_rad,
            bias_radps=noise.gyro_bias_std_radps,
        ),
        MotionLimits(),
        motion.wheel_radius_m,
        motion.wheel_base_m,
    )
