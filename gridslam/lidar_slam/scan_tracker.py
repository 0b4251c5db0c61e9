"""Tracks the robot over a log: gives each scan its odometry, runs the front end, and selects key scans."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Imu, LaserScan, Odometry, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.scan_matching.scan_points import LEVEL
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.empty_scans import EmptyScans
from gridslam.lidar_slam.front_end import ScanMatch, Tracking
from gridslam.lidar_slam.key_scans import KeyScanSpacing
from gridslam.lidar_slam.motion_prediction import FIRM_STD_M, MotionPredictor
from gridslam.lidar_slam.odometry_noise import MIN_UNSCANNED_M, odometry_limits, unscanned_std
from gridslam.lidar_slam.open_stretches import OpenStretches
from gridslam.lidar_slam.packed_scans import PackedScans
from gridslam.lidar_slam.scan_breaks import ScanBreaks
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.lidar_slam.slips import slip_variances
from gridslam.lidar_slam.sway import MIN_HEIGHT_M, Sway, SwayObserver, levelled
from gridslam.lidar_slam.tracked_path import TrackedPath
from gridslam.lidar_slam.unmeasured_gaps import UnmeasuredGaps
from gridslam.motion.scan_poses import PlacedScan, ScanPoses
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]

NO_SLIP = np.zeros(3)
MAX_WAIT_S = 10.0  # a scan that has waited longer for odometry is tracked without any


def lidar_of(scan: LaserScan) -> str:
    """The lidar that took a scan: its frame, without the stamp that the frame of a lidar on a moving joint has."""
    return scan.frame_id.partition("@")[0]


class ScanTracker:
    """Tracks the robot: adds each scan to `path`, and selects key scans.

    For each scan that `process` or `flush` yields, a method calls `prepare`, `track` and, when `is_key_scan_due`, `add_key_scan`;
    `track_scan` is these together.
    """

    def __init__(
        self, front_end: Tracking, scan: ScanConfig, odometry: OdometryConfig, spacing: KeyScanSpacing
    ) -> None:
        self._front_end = front_end
        self._scan_config = scan
        self._spacing = spacing
        self._scan_poses = ScanPoses(odometry_limits(odometry), max_wait_s=MAX_WAIT_S)
        self._predictor = MotionPredictor()
        self._gaps = UnmeasuredGaps()
        self._open_stretches = OpenStretches()
        self._breaks = ScanBreaks()
        # Velocity (vx, vy, wz) `(3,)` at a stamp, to be used instead of a prediction
        self.known_twist: Callable[[int], Floats] | None = None
        self._counters: Counter[str] = Counter()
        self._empty_scans = EmptyScans()
        self.sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self.path = TrackedPath()
        self.key_scans = PackedScans()
        self._sway_observer = SwayObserver()
        self.sway: Sway | None = None  # found by `remove_sway`
        # Heights of the lidars above the base, NaN for tilted ones
        self._level_heights_m: dict[str, float] = {}
        # Height of the lidar at every scan, NaN if it is tilted or the scan is made from a cloud
        self._heights_m: list[float] = []

    @property
    def counters(self) -> Counter[str]:
        """Scans and odometry used, skipped and not matched."""
        empty = Counter({"scan.empty": self._empty_scans.count})
        return self._counters + empty + self._scan_poses.counters

    def forget_key_scans(self) -> None:
        """Free the memory of the key scans, after the last use of them."""
        self.key_scans = PackedScans()

    @property
    def motion_measures(self) -> dict[str, object]:
        """Sources of the predicted motion between scans, with their errors, for the report."""
        return self._predictor.measures()

    @property
    def open_stretch(self) -> dict[str, float]:
        """The stretch on which the scans show least how far the robot moved, for the report."""
        return self._open_stretches.measures

    @property
    def is_gyro_poor(self) -> bool:
        """Whether the gyro's rotations are worse than those at constant velocity."""
        return self._predictor.is_gyro_poor

    @property
    def motion_notes(self) -> list[str]:
        """Lines for the user about sensors of motion that contradict the scans, and about scans without readings."""
        sway = [] if self.sway is None else [self.sway.note]
        return [*self._predictor.notes, *sway, *self._empty_scans.notes(len(self.path))]

    def refuse_without_readings(self) -> None:
        """Raises MethodError: no scan has a reading within its limits."""
        self._empty_scans.refuse_all_empty(len(self.path))

    @property
    def is_erratic(self) -> bool:
        """Whether without odometry the motion changes so much from scan to scan that matching probably jumps."""
        return self._predictor.doubt is not None

    @property
    def motion_doubt(self) -> str | None:
        """The reason, in words, to distrust a path that no other passage confirms; None without one."""
        return self._predictor.doubt or self._gaps.doubt

    def sensor_doubt(self, loops: Edges) -> str | None:
        """The reason, in words, to distrust the map of a robot that was carried or sways, or of walls that leave its motion open.

        `loops` are the accepted loop closures between key scans.
        """
        carried = self._breaks.doubt(self.path.stamps_of(loops))
        return carried or (self.sway and self.sway.doubt) or self._open_stretches.doubt

    def process(self, event: Event) -> Iterator[PlacedScan]:
        """Process odometry, a yaw rate, a scan or extrinsics; yields the scans that need not wait for odometry any more."""
        if isinstance(event, Odometry):
            self._sway_observer.add_odometry(event.stamp_ns)
            yield from self._scan_poses.add_odometry(event)
        elif isinstance(event, LaserScan):
            yield from self._scan_poses.add_scan(event)
        elif isinstance(event, Imu):
            self._predictor.add_imu(event, self._is_flipped(event.frame_id))
        elif isinstance(event, Transform) and event.is_static:
            extrinsics = extrinsics_of(event)
            self.sensor_extrinsics[event.child_frame_id] = extrinsics
            is_level = extrinsics.projection == LEVEL
            self._level_heights_m[event.child_frame_id] = event.translation_m[2] if is_level else math.nan

    def flush(self) -> Iterator[PlacedScan]:
        """The scans that still wait for odometry at the end of the log."""
        yield from self._scan_poses.flush()

    def lidar_extrinsics(self, scan: LaserScan) -> LidarExtrinsics:
        """The lidar's pose in the robot's frame; the robot's origin if the log has no extrinsics for it."""
        return self.sensor_extrinsics.get(scan.frame_id, LidarExtrinsics(np.zeros(3)))

    def _is_flipped(self, frame_id: str) -> bool:
        extrinsics = self.sensor_extrinsics.get(frame_id)
        return extrinsics is not None and extrinsics.flipped

    def twist(self, placed: PlacedScan) -> Floats:
        """Velocity (vx, vy, wz) `(3,)` since the last tracked scan, by odometry or, without odometry, as predicted."""
        if self.known_twist is not None:
            return self.known_twist(placed.scan.stamp_ns)
        return self._predictor.twist(placed)

    def prepare(self, placed: PlacedScan) -> PreparedScan:
        """The scan's points, with the robot's motion during the sweep removed."""
        scan = placed.scan
        prepared = prepare_scan(scan, self.lidar_extrinsics(scan), self.twist(placed), self._scan_config)
        if not len(prepared.points):
            self._empty_scans.add(scan)
        return prepared

    def track(self, placed: PlacedScan, scan: PreparedScan) -> ScanMatch:
        """Match the scan and append its pose to the path."""
        motion = self._predictor.predict(placed)
        match = self._front_end.track(scan, motion.odometry, motion.min_std)
        self._counters["scan.unmatched"] += not match.is_matched
        uses_odometry = self._predictor.uses_odometry(placed)
        slip = self._observe_step(scan.stamp_ns, match, uses_odometry) if len(self.path) else NO_SLIP
        self._breaks.add(scan.stamp_ns, match, len(scan.points))
        pose = self._front_end.pose.copy()
        self.path.append(scan.stamp_ns, pose, match, lidar_of(placed.scan), slip)
        is_certain = match.is_matched and match.position_std_m < FIRM_STD_M
        self._sway_observer.add_scan(placed.odometry, placed.odometry_jumped, is_certain and uses_odometry)
        height_m = self._level_heights_m.get(placed.scan.frame_id, math.nan)
        self._heights_m.append(math.nan if placed.scan.is_of_cloud else height_m)
        self._predictor.add_match(placed, match)
        return match

    def _observe_step(self, stamp_ns: int, match: ScanMatch, uses_odometry: bool) -> Floats:
        """Note how well the step from the last scan to this one is known; the scan is added to the path after that.

        Returns the variances `(3,)` of x, y and yaw by which the robot may have slipped.
        """
        elapsed_s = (stamp_ns - self.path.stamps_ns[-1]) * 1e-9
        if len(self.path) > 1 and not uses_odometry:
            self._gaps.add(elapsed_s, self.path.last_speed_mps, match)
        step = se2.between(self.path.pose, match.pose)
        travel_m = math.hypot(*step[:2].tolist())
        self._open_stretches.add(travel_m, max(elapsed_s, 0.0), match, uses_odometry)
        if not uses_odometry:
            return slip_variances(step, elapsed_s, match)
        # One array for all short steps of a log
        return NO_SLIP if travel_m < MIN_UNSCANNED_M else unscanned_std(step) ** 2

    def track_scan(self, placed: PlacedScan) -> PreparedScan:
        """Prepare and track a scan, and make it a key scan when one is due."""
        scan = self.prepare(placed)
        self.track(placed, scan)
        if self.is_key_scan_due:
            self.add_key_scan(scan)
        return scan

    def track_all(self, events: Iterable[Event]) -> Trajectory:
        """Track the scans among events, and those that still wait; returns the path over all scans so far."""
        for placed in chain(chain.from_iterable(map(self.process, events)), self.flush()):
            self.track_scan(placed)
        return self.path.trajectory()

    @property
    def is_key_scan_due(self) -> bool:
        """Whether the last scan is far enough from the last key scan of its lidar; the first scan always is."""
        last = self.path.last_key_pose
        return last is None or self._spacing.is_due(last, self.path.pose)

    def add_key_scan(self, scan: PreparedScan) -> Floats:
        """Make the last tracked scan a key scan; returns the motion `(3,)` since the previous key scan, zero for the first."""
        self._front_end.add_key_scan(scan)
        self.key_scans.append(scan)
        return self.path.make_key()

    def remove_sway(self) -> None:
        """Find the sway of the robot after the last scan, and level the key scans if the heights of all lidars are known."""
        trajectory = self.path.trajectory()
        self.sway = self._sway_observer.sway_of(trajectory.stamps_ns, trajectory.poses)
        heights_m = np.array(self._heights_m)[self.path.keys]
        if self.sway is None or not (heights_m >= MIN_HEIGHT_M).all():
            return
        self.sway = replace(self.sway, is_levelled=True)
        swung, self.key_scans = self.key_scans, PackedScans()
        for row, scan, height_m in zip(self.path.keys, swung, heights_m.tolist(), strict=True):
            self.key_scans.append(levelled(scan, self.sway.shifts_m[row], height_m))

    def corrected(self, key_poses: Floats) -> Trajectory:
        """The path over all scans without the robot's sway, given the final poses `(k, 3)` of the key scans."""
        corrected = self.path.corrected(key_poses)
        return (
            corrected
            if self.sway is None
            else replace(corrected, poses=self.sway.removed_from(corrected.poses))
        )
