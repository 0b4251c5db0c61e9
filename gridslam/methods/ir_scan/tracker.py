"""From events to stops: motion, fixes and sweeps are put together here, for mapping and for localization alike."""

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
from gridslam.methods.ir_scan.matching import Match
from gridslam.methods.ir_scan.stops import Factor, Place
from gridslam.motion.wheel_gyro import MotionLimits, WheelGyro, WheelGyroNoise
from gridslam.sensors.infrared import InfraredScan, reliability, reliable_ends
from gridslam.sensors.infrared_sweeps import OpenedScan, SweepAssembler, SweepLimits
from gridslam.sensors.lidar_beams import extrinsics_of

Floats = NDArray[np.float64]

_GATE = 11.34  # chi-square with 3 degrees of freedom, 0.99


class Tracker:
    """Follows the robot from stop to stop. `places[0]` is the start; every complete scan adds a place."""

    def __init__(self, config: IrScanConfig, start_covariance: Floats) -> None:
        self._config = config
        self._motion = _motion_of(config)
        sweep = config.sweep
        self._sweeps = SweepAssembler(
            SweepLimits(sweep.gap_s, sweep.moved_m, sweep.moved_rad, sweep.back_rad)
        )
        start = np.array(config.start if config.start is not None else (0.0, 0.0, 0.0))
        self.places = [Place(0, start, start_covariance, start, None)]
        self._is_placed = config.start is not None  # whether a fix may no longer choose the map's frame
        self._given: Factor | None = None  # the last fix, as long as there is no odometry
        self.counters: Counter[str] = Counter()
        self._takers: dict[type[Event], Callable[[Any], Place | None]] = {
            Range: self._take_range,
            Odometry: self._take_odometry,
            WheelTicks: self._take_wheels,
            AbsolutePose: self._take_fix,
            Transform: self._take_transform,
        }
        if config.motion.use_gyro:
            self._takers[Imu] = self._motion.add_imu

    @property
    def motion(self) -> WheelGyro:
        """Odometry so far."""
        return self._motion

    def take(self, event: Event) -> Place | None:
        """Take in an event; returns the place of a scan that it completes, to be settled by `settle`."""
        taker = self._takers.get(type(event))
        return None if taker is None else taker(event)

    def _take_range(self, event: Range) -> Place | None:
        motion = self._motion
        opened = self._sweeps.add(event, motion.total_rows, motion.travelled_m, motion.turned_rad)
        return None if opened is None else self._arrive(opened)

    def _take_odometry(self, event: Odometry) -> Place | None:
        self._motion.add_odometry(event)
        return self._moved()

    def _take_wheels(self, event: WheelTicks) -> Place | None:
        self._motion.add_wheels(event)
        return self._moved()

    def _moved(self) -> Place | None:
        """The place of the scan that the robot has left, if it has."""
        opened = self._sweeps.moved(self._motion.travelled_m, self._motion.turned_rad)
        return None if opened is None else self._arrive(opened)

    def _take_transform(self, event: Transform) -> None:
        if event.is_static:
            self._sweeps.sensor_extrinsics[event.child_frame_id] = extrinsics_of(event)

    def finish(self) -> Place | None:
        """The place of the scan that is still open at the end of the log."""
        self._motion.flush()
        opened = self._sweeps.flush()
        return None if opened is None else self._arrive(opened)

    def settle(self, place: Place, match: Match) -> None:
        """What the map said about a place."""
        place.pose, place.covariance = match.pose, match.covariance
        place.pose[2] = float(se2.wrap_angle(place.pose[2]))
        place.verdict, place.score = match.verdict, match.score
        self.counters[f"scan.{match.verdict}"] += 1

    def end(self) -> None:
        """Run the odometry to the end of the log."""
        self._motion.advance_to(self._motion.total_rows)

    def all_counters(self) -> Counter[str]:
        """Those of motion, sweeps and readings."""
        return self.counters + self._motion.counters + self._sweeps.counters

    def _arrive(self, opened: OpenedScan) -> Place:
        self._check_motion()
        motion, last = self._motion, self.places[-1]
        motion.advance_to(opened.mark)
        stretch = motion.stop()
        pose, covariance = moved(last.pose, last.covariance, stretch.T_stop_now, stretch.covariance)
        fixes = []
        if not motion.is_known and self._given is not None:
            pose, covariance, fixes = self._given.pose.copy(), self._given.covariance, [self._given]
        place = Place(opened.scan.stamp_ns, pose, covariance, pose.copy(), stretch, fixes=fixes)
        place.has_odometry = motion.is_known
        self._read(place, opened.scan)
        self.places.append(place)
        return place

    def _read(self, place: Place, scan: InfraredScan) -> None:
        """The scan's readings, sorted into those that are used and those that are not."""
        scan = self._limited(scan)
        ends = reliable_ends(scan, reliability(scan, self._config.readings.neighbour_m))
        valid = int(scan.is_valid().sum())
        self.counters["used.range"] += len(ends)
        self.counters["skipped.range.out_of_limits"] += len(scan) - valid
        self.counters["skipped.range.unreliable"] += valid - len(ends)
        self.counters["scan.all_invalid"] += valid == 0
        self.counters["scans"] += 1
        place.scan, place.ends = scan, ends

    def _limited(self, scan: InfraredScan) -> InfraredScan:
        """The scan with the limits that the config sets."""
        low, high = scan.range_min_m.copy(), scan.range_max_m.copy()
        for k, name in enumerate(scan.names):
            if (limits := self._config.readings.limits.get(name)) is not None:
                low[scan.sensor == k], high[scan.sensor == k] = limits.min_m, limits.max_m
        return replace(scan, range_min_m=low, range_max_m=high)

    def _check_motion(self) -> None:
        """Raises MethodError where nothing says how the robot moved: a map made so would be wrong."""
        if self._motion.is_known or self._given is not None:
            return
        if self._motion.counters["unused.wheels"]:
            raise MethodError(
                "the log has wheel angles but no odometry: set method.motion.wheel_radius_m and wheel_base_m"
            )
        if len(self.places) > 1 or self._config.start is None:
            raise MethodError(
                "there are readings, but no odometry, wheel angles or fixes before them: nothing says where the robot "
                "stood; choose these streams under log.topics"
            )

    def _take_fix(self, event: AbsolutePose) -> Place | None:
        """A pose from outside corrects the last place through the motion since; without odometry it is the pose."""
        if not (np.isfinite(event.pose).all() and np.isfinite(event.covariance).all()):
            self.counters["skipped.fix.not_finite"] += 1
            return None
        pose, covariance = np.array(event.pose), np.array(event.covariance)
        if not self._motion.is_known:
            return self._jump_to(Factor(pose, covariance))
        self._motion.advance_to(self._motion.total_rows)
        since, last = self._motion.stretch(), self.places[-1]
        if not self._is_placed:
            if len(self.places) > 1:
                self.counters["skipped.fix.after_first_scan"] += 1
                return None
            last.pose = se2.compose(pose, se2.inverse(since.T_stop_now))
            last.covariance = covariance + since.covariance
            self._is_placed = True
            self.counters["used.fix"] += 1
            return None
        self._correct(last, since.T_stop_now, since.covariance, pose, covariance)
        return None

    def _correct(self, last: Place, step: Floats, step_covariance: Floats, pose: Floats, fix: Floats) -> None:
        """A Kalman update of the last place by a fix taken `step` further on, unless the fix is an outlier."""
        predicted, spread = moved(last.pose, last.covariance, step, step_covariance)
        off = pose - predicted
        off[2] = float(se2.wrap_angle(off[2]))
        innovation = spread + fix
        if float(off @ np.linalg.solve(innovation, off)) > _GATE:
            self.counters["skipped.fix.outlier"] += 1
            return
        F, _ = jacobians(last.pose, step)
        gain = last.covariance @ F.T @ np.linalg.inv(innovation)
        last.pose = last.pose + gain @ off
        last.covariance = last.covariance - gain @ F @ last.covariance
        back = np.linalg.inv(F)
        last.fixes.append(
            Factor(se2.compose(pose, se2.inverse(step)), back @ (fix + step_covariance) @ back.T)
        )
        self.counters["used.fix"] += 1

    def _jump_to(self, fix: Factor) -> Place | None:
        """Without odometry a fix at another place ends the scan, and is where the next one is taken."""
        self.counters["used.fix"] += 1
        before, done = self._given, None
        if before is not None:
            away = np.abs(se2.between(before.pose, fix.pose))
            limits = self._config.sweep
            if max(away[0], away[1]) <= limits.moved_m and away[2] <= limits.moved_rad:
                return None
        opened = self._sweeps.flush()
        if opened is not None:
            done = self._arrive(opened)
        self._given = fix
        return done


def moved(pose: Floats, covariance: Floats, step: Floats, step_covariance: Floats) -> tuple[Floats, Floats]:
    """A pose `(3,)` and its covariance after an uncertain step in its own frame (Smith, Self, Cheeseman 1990)."""
    F, G = jacobians(pose, step)
    return se2.compose(pose, step), F @ covariance @ F.T + G @ step_covariance @ G.T


def jacobians(pose: Floats, step: Floats) -> tuple[Floats, Floats]:
    """Derivatives (3, 3) of compose(pose, step) by the pose and by the step."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = c * step[0] - s * step[1], s * step[0] + c * step[1]
    by_pose = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    by_step = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return by_pose, by_step


def _motion_of(config: IrScanConfig) -> WheelGyro:
    motion = config.motion
    noise = WheelGyroNoise(
        forward_per_root_m=motion.forward_per_root_m,
        sideways_per_root_m=motion.sideways_per_root_m,
        turn_per_root_m=motion.turn_per_root_m,
        turn_per_root_rad=motion.turn_per_root_rad,
        gyro_per_root_s=motion.gyro_per_root_s,
        gyro_scale=motion.gyro_scale,
        bias_radps=motion.bias_radps,
        bias_per_root_s=motion.bias_per_root_s,
    )
    limits = MotionLimits(motion.max_speed_mps, motion.max_turn_radps)
    return WheelGyro(noise, limits, motion.wheel_radius_m, motion.wheel_base_m)
