"""Holds back the first part of a log until its odometry and scans are checked against each other, then gives all events on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform, as_float32
from gridslam.core.stopwatch import Stopwatch
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.level_check import LevelledScans
from gridslam.lidar_slam.mount_calibration import (
    assumed_mount,
    misplaced_note,
    mount_note,
    solve_mount,
    with_mount,
)
from gridslam.lidar_slam.odometry_calibration import OdometryCorrection, calibrate, windows_of
from gridslam.lidar_slam.own_body import LaterBodies, OwnBody, find_own_bodies
from gridslam.lidar_slam.scan_angles import ScanAngles, find_wrong_angles
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of
from gridslam.lidar_slam.sweep_calibration import SweepTime, find_sweep_time, stamped_at_end, stated_sweep_s

Floats = NDArray[np.float64]

MIN_ROTATION_RAD, MIN_DISTANCE_M = 4.0, 6.0  # motion by odometry that is enough to judge it by
# Largest number of scans where the robot moves less, or no lag is certain; bounds memory and delay
MAX_SCANS = 600
STANDING_M, STANDING_RAD = 0.3, 0.3  # a robot that has moved less has not driven off yet, and shows nothing
MAX_STANDING_SCANS = 3000  # largest number of scans that are held until the robot moves


class OdometryCheck:
    """Gives on the events of a log, with odometry corrected where it is wrong, and scans without returns from the robot itself.

    Good odometry and scans stay as they are.

    `build_tracker` makes the tracker that follows the first scans without odometry. After `flush` all events are given on at
    once.
    """

    def __init__(self, build_tracker: Callable[[], ScanTracker], stopwatch: Stopwatch) -> None:
        self._build_tracker = build_tracker
        self._stopwatch = stopwatch
        self._tracker: ScanTracker | None = build_tracker()
        self._held: list[Event] | None = []
        self._tracked = 0  # of the held events
        self._scans = 0
        self._max_scans = MAX_SCANS
        self._next_check = (
            0  # number of scans from which on odometry is checked, once the robot has moved enough
        )
        self._moved = np.zeros(2)  # m, rad
        self._last: Odometry | None = None
        self._early: deque[Event] = deque()  # corrected odometry, and what else is later than the last scan
        self.correction = OdometryCorrection()
        self.own_bodies: list[OwnBody] = []
        self._later_bodies = LaterBodies()
        self.angles: list[ScanAngles] = []
        self.reverses_scans = False  # those whose messages contradict themselves about their sense
        self.sweep: SweepTime | None = None  # where the messages say none, or the wrong one
        self.late_scans_s = 0.0  # of scans that are stamped when their sweep is complete
        self.mount: Transform | None = None  # of a lidar of which the log does not say where it is
        self.misplaced = ""  # a line about a lidar that is not where the log says
        self.checked_scans = 0
        self.levels = LevelledScans({})

    def process(self, event: Event) -> Iterator[Event]:
        """Take in an event; yields nothing until the check is done, and then all events."""
        if self._held is None:
            if isinstance(event, Odometry):
                self._measure(event)
            yield from self._give(event)
            return
        self._held.append(event)
        if isinstance(event, Odometry):
            self._measure(event)
        elif isinstance(event, LaserScan):
            self._scans += 1
            has_moved = self._moved[0] > MIN_DISTANCE_M and self._moved[1] > MIN_ROTATION_RAD
            if self._scans >= self._max_scans and self._is_standing:
                self._max_scans = self._scans + MAX_SCANS
            if self._scans >= self._max_scans or (has_moved and self._scans >= self._next_check):
                yield from self._check()

    @property
    def _is_standing(self) -> bool:
        """Whether by odometry the robot has not driven off yet, and more scans of this may be held."""
        has_moved = self._moved[0] >= STANDING_M or self._moved[1] >= STANDING_RAD
        return self._last is not None and not has_moved and self._scans < MAX_STANDING_SCANS

    def flush(self) -> Iterator[Event]:
        """The events that are still held back."""
        if self._held is not None:
            yield from self._check(is_last=True)
        yield from self._early
        self._early.clear()

    def measures(self) -> dict[str, object]:
        """The correction and the number of checked scans, for the report."""
        found = self.correction
        return {
            "checked_scans": self.checked_scans,
            "lag_s": round(found.lag_s, 3),
            "possible_lags_s": found.possible_lags_s and [round(lag, 3) for lag in found.possible_lags_s],
            "distance_scale": round(1.0 / found.scale, 3),
            "yaw_sign": -1 if found.mirrors_yaw else 1,
            "is_corrected": bool(found.faults),
            "sweep_s": None if self.sweep is None else round(self.sweep.sweep_s, 4),
            "late_scans_s": round(self.late_scans_s, 4),
        }

    def notes(self) -> list[str]:
        """One line that names the faults, and one for each body in view; empty for a good log."""
        faults = self.correction.faults
        wrong = [f"odometry contradicts the scans: {', '.join(faults)}; used corrected"] if faults else []
        found = [] if self.mount is None else [mount_note(self.mount)]
        found += [self.misplaced] if self.misplaced else []
        if self.levels.note is not None:
            found.append(self.levels.note)
        found += [angles.note for angles in self.angles]
        if self.reverses_scans:
            found.append(
                "the sense of the scans' angles, which they contradict themselves about, is that of the odometry"
            )
        if self.sweep is not None:
            found.append(self.sweep.note)
        if self.late_scans_s:
            found.append(
                f"by the odometry the scans are stamped at the end of their sweep, {self.late_scans_s:.3f} s after the first "
                "beam: their stamps, and those of the poses, are moved"
            )
        return wrong + found + [body.note for body in self.own_bodies]

    def _check(self, is_last: bool = False) -> Iterator[Event]:
        """Decide on the odometry and give on the events held back; wait for more motion where that may decide better."""
        held = self._held or []
        with self._stopwatch.stage("odometry_check"):
            is_decided = self._decide(held, is_last)
        if not is_decided:
            self._next_check = 2 * self._scans
            return
        self._held, self._tracker = None, None
        for event in held:
            yield from self._give(event)

    def _decide(self, held: list[Event], is_last: bool) -> bool:
        """Find the faults of odometry and scans; whether more motion would not decide better."""
        odometry = [e for e in held if isinstance(e, Odometry) and np.isfinite(e.pose).all()]
        self._find_own_bodies(held)
        if not self._tracked:
            self.levels = LevelledScans.among(held).decided(held, self._build_tracker)
        if len(odometry) > 1 and self._scans > 1:
            by_odometry = _trajectory(odometry)
            self._find_wrong_angles(held, by_odometry)
            path = self._decide_sense(held, self._path(held), by_odometry)
            self.correction = calibrate(path, by_odometry)
            self._find_mount(held, path, by_odometry)
        if self.correction.is_undecided and not is_last and self._scans < self._max_scans:
            return False
        if self._scans > 1:
            repaired = [self._repaired(event) for event in held]
            self._path(held)
            if self._tracker is not None:
                self.sweep = find_sweep_time(repaired, self._tracker, self._build_tracker)
            self._find_late_scans(held, odometry)
        return True

    def _find_late_scans(self, held: list[Event], odometry: list[Odometry]) -> None:
        """Look whether the scans, and not the odometry, have the wrong stamps."""
        scans = [e for e in held if isinstance(e, LaserScan)]
        if len(odometry) < 2 or len(set(map(lidar_of, scans))) != 1:
            return
        if self.sweep is not None and self.correction.lag_s:  # the path was that of scans with other times
            self._tracker, self._tracked = self._build_tracker(), 0
            self.correction = calibrate(self._path(held), _trajectory(odometry))
        sweep_s = stated_sweep_s([scan for e in scans if isinstance(scan := self._repaired(e), LaserScan)])
        if stamped_at_end(self.correction.lag_s, sweep_s):
            self.late_scans_s = sweep_s
            self.correction = replace(self.correction, lag_s=0.0)

    def _give(self, event: Event) -> Iterator[Event]:
        """The event with corrections; odometry waits until events have reached its corrected stamp.

        Where scans are late, all else but transforms waits for them.
        """
        event = self._without_later_bodies(self._repaired(event))
        if (
            self.mount is not None
            and isinstance(event, Transform)
            and event.child_frame_id == self.mount.child_frame_id
        ):
            event = self.mount
        if not (self.correction.faults or self.late_scans_s):
            yield event
        elif isinstance(event, Odometry):
            self._early.append(self.correction.corrected(event))
        elif self.late_scans_s and not isinstance(event, LaserScan):
            if isinstance(event, Transform):
                yield event
            else:
                self._early.append(event)
        else:
            while self._early and self._early[0].stamp_ns <= event.stamp_ns:
                yield self._early.popleft()
            yield event

    def _without_later_bodies(self, event: Event) -> Event:
        """A scan without the parts of the robot that its lidar sees since the check; other events as they are."""
        if not isinstance(event, LaserScan):
            return event
        body = self._later_bodies.found_in(event, float(self._moved[1]))
        if body is None:
            return event
        self.own_bodies.append(body)
        return body.removed_from(event)

    def _measure(self, odometry: Odometry) -> None:
        if self._last is not None and np.isfinite(odometry.pose).all():
            step = se2.between(self._last.pose, odometry.pose)
            self._moved += (np.hypot(step[0], step[1]), abs(step[2]))
        if np.isfinite(odometry.pose).all():
            self._last = odometry

    def _decide_sense(self, held: list[Event], path: Trajectory, odometry: Trajectory) -> Trajectory:
        """The path, anew with the beams of scans of uncertain sense reversed where odometry turns the other way."""
        is_uncertain = any(isinstance(e, LaserScan) and e.has_uncertain_sense for e in held)
        if self.reverses_scans or not is_uncertain or not calibrate(path, odometry).mirrors_yaw:
            return path
        self.reverses_scans, self._tracker, self._tracked = True, self._build_tracker(), 0
        return self._path(held)

    def _find_wrong_angles(self, held: list[Event], odometry: Trajectory) -> None:
        """Find lidars whose messages state wrong angles; the path begins anew where there are any."""
        if self.angles:
            return
        scans = [scan for e in held if isinstance(scan := self._repaired(e), LaserScan)]
        self.angles = find_wrong_angles(scans, odometry, self._build_tracker)
        if self.angles:
            self._tracker, self._tracked = self._build_tracker(), 0

    def _find_mount(self, held: list[Event], path: Trajectory, odometry: Trajectory) -> None:
        """Find where the only lidar sits, if the log does not say it."""
        frames = {e.frame_id for e in held if isinstance(e, LaserScan)}
        assumed = assumed_mount(held, next(iter(frames))) if len(frames) == 1 else None
        windows = windows_of(path, odometry)
        self.mount, self.misplaced = None, ""
        if (
            len(frames) != 1
            or windows is None
            or (mount := solve_mount(*windows.motions(self.correction))) is None
        ):
            return
        if assumed is None:
            self.misplaced = misplaced_note(next(iter(frames)), mount)
            return
        base = next(e.child_frame_id for e in held if isinstance(e, Odometry))
        self.mount = with_mount(assumed, mount, base)

    def _find_own_bodies(self, held: list[Event]) -> None:
        """Look for the robot's body in the scans of a robot that turns: beside a straight drive a wall looks like one."""
        self.own_bodies = find_own_bodies(e for e in held if isinstance(e, LaserScan))
        if self.own_bodies and self._moved[1] < MIN_ROTATION_RAD:
            yaw = np.unwrap(self._path(held).poses[:, 2])
            if np.abs(np.diff(yaw)).sum() < MIN_ROTATION_RAD:
                self.own_bodies = []
        self.own_bodies += _later_bodies(held, self.own_bodies)

    def _repaired(self, event: Event) -> Event:
        """A scan without returns from the robot and in its right sense; other events as they are."""
        event = self.levels.applied_to(event)
        if not isinstance(event, LaserScan):
            return event
        for body in self.own_bodies:
            event = body.removed_from(event)
        for angles in self.angles:
            event = angles.applied_to(event)
        if self.sweep is not None:
            event = self.sweep.applied_to(event)
        if self.late_scans_s:
            begun_ns = event.stamp_ns - round(self.late_scans_s * 1e9)
            event = replace(event, stamp_ns=max(begun_ns, 0))  # simulated clocks begin at 0
        return reversed_sense(event) if self.reverses_scans and event.has_uncertain_sense else event

    def _path(self, held: list[Event]) -> Trajectory:
        """The path over the held scans by matching alone."""
        tracker = self._tracker
        if tracker is None:
            return Trajectory.empty()
        scans = [self._repaired(e) for e in held[self._tracked :] if not isinstance(e, Odometry)]
        for placed in chain.from_iterable([*map(tracker.process, scans), tracker.flush()]):
            tracker.track_scan(placed)
        self._tracked, self.checked_scans = len(held), len(tracker.stamps_ns)
        return Trajectory(np.array(tracker.stamps_ns, np.int64), np.array(tracker.track_poses).reshape(-1, 3))


def reversed_sense(scan: LaserScan) -> LaserScan:
    """The scan with the same readings, the first one at the angle of the last."""
    last_rad = scan.angle_min_rad + scan.angle_increment_rad * (len(scan.ranges_m) - 1)
    return replace(
        scan, angle_min_rad=as_float32(last_rad), angle_increment_rad=as_float32(-scan.angle_increment_rad)
    )


def _later_bodies(held: list[Event], known: list[OwnBody]) -> list[OwnBody]:
    """Parts of the robot that its lidars see during a part of the events only, besides the known ones."""
    later, turned_rad = LaterBodies(), 0.0
    last_rad: float | None = None
    found: list[OwnBody] = []
    for event in held:
        if isinstance(event, Odometry) and math.isfinite(event.yaw_rad):
            turned_rad += abs(
                math.remainder(event.yaw_rad - (event.yaw_rad if last_rad is None else last_rad), 2 * math.pi)
            )
            last_rad = event.yaw_rad
        elif isinstance(event, LaserScan):
            for body in (*known, *found):
                event = body.removed_from(event)
            if (new := later.found_in(event, turned_rad)) is not None:
                found.append(new)
    return found


def _trajectory(odometry: list[Odometry]) -> Trajectory:
    return Trajectory(
        np.array([o.stamp_ns for o in odometry], np.int64), np.array([o.pose for o in odometry])
    )
