"""Tracks the robot over a log: joins scans with odometry, runs the front end, selects key scans."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.core.messages import Event, Imu, LaserScan, Odometry, Transform
from gridslam.core.trajectory import Trajectory, stretches
from gridslam.graph.pose_graph import Edges
from gridslam.kernels.scan_matching.scan_points import LEVEL
from gridslam.lidar_slam.config import OdometryConfig, ScanConfig
from gridslam.lidar_slam.front_end import ScanMatch, Tracking
from gridslam.lidar_slam.key_scans import KeyScanSpacing, distribute_corrections
from gridslam.lidar_slam.motion_prediction import FIRM_STD_M, MIN_TWIST_S, MotionPredictor
from gridslam.lidar_slam.odometry_noise import odometry_limits
from gridslam.lidar_slam.open_stretches import OpenStretches, is_open
from gridslam.lidar_slam.packed_scans import PackedScans
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.lidar_slam.slips import slip_variances
from gridslam.lidar_slam.sway import MIN_HEIGHT_M, Sway, SwayObserver, levelled
from gridslam.lidar_slam.unmeasured_gaps import UnmeasuredGaps
from gridslam.motion.scan_poses import PlacedScan, ScanPoses
from gridslam.sensors.lidar_beams import LidarExtrinsics, extrinsics_of

Floats = NDArray[np.float64]

NO_SLIP_M2 = np.zeros(2)
MANY_EMPTY = 0.5  # fraction of the scans: from here on a line says that they have no readings
MAX_WAIT_S = 10.0  # a scan that has waited longer for odometry is tracked without any


def lidar_of(scan: LaserScan) -> str:
    """The lidar that took a scan: its frame, without the stamp that the frame of a lidar on a moving joint has."""
    return scan.frame_id.partition("@")[0]


class ScanTracker:
    """The robot's path over all scans in the front end's frame, and the key scans on it.

    For each scan of `process` or `flush` a method calls `prepare`, `track` and, when `is_key_scan_due`, `add_key_scan`.
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
        self.known_twist: Callable[[int], Floats] | None = None  # at a stamp, where it is known beforehand
        self._counters: Counter[str] = Counter()
        self._last_readings = ""  # of an empty scan, in words
        self.sensor_extrinsics: dict[str, LidarExtrinsics] = {}
        self.stamps_ns: list[int] = []
        self.track_poses: list[Floats] = []  # T_track_base (3,) of every scan
        self._matches: list[ScanMatch] = []
        self._slips_m2: list[Floats] = []  # of every scan's step
        self.keys: list[int] = []  # rows of the key scans among all scans
        self.key_scans = PackedScans()
        self._lidar = ""  # of the last tracked scan
        self._lidars: list[str] = []  # of every scan
        self._last_key_of: dict[str, int] = {}  # row of each lidar's last key scan
        self._sway_observer = SwayObserver()
        self.sway: Sway | None = None  # of the whole path, after `remove_sway`
        self._level_heights_m: dict[str, float] = {}  # of lidars above the base, NaN for tilted ones
        self._heights_m: list[
            float
        ] = []  # of every scan's lidar, if it is level and its scan planar, else NaN

    @property
    def counters(self) -> Counter[str]:
        """Scans and odometry used, skipped and not matched."""
        return self._counters + self._scan_poses.counters

    @property
    def pose(self) -> Floats:
        """T_track_base (3,) at the last scan; there must be one."""
        return self.track_poses[-1]

    def forget_key_scans(self) -> None:
        """Free the memory of the key scans, which only drawing and comparing them needs."""
        self.key_scans = PackedScans()

    @property
    def key_poses(self) -> Floats:
        """The front end's poses `(k, 3)` of the key scans."""
        return np.array(self.track_poses)[self.keys]

    @property
    def key_stamps_ns(self) -> NDArray[np.int64]:
        """Stamps `(k,)` of the key scans."""
        return np.array(self.stamps_ns, np.int64)[self.keys]

    def stamps_of(self, loops: Edges) -> NDArray[np.int64]:
        """Stamps `(l, 2)` of the key scans that edges join."""
        return np.stack([self.key_stamps_ns[loops.source], self.key_stamps_ns[loops.target]], axis=1)

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
        empty = self._counters["scan.empty"]
        found = self._predictor.notes if self.sway is None else [*self._predictor.notes, self.sway.note]
        if not empty or empty < MANY_EMPTY * len(self.stamps_ns):
            return found
        return [
            *found,
            f"{empty} of {len(self.stamps_ns)} scans have no reading within their limits: check range_min, range_max, unit",
        ]

    def refuse_without_readings(self) -> None:
        """Raises MethodError: not one of the scans has a reading within its limits, and the path would be that of odometry."""
        if self.stamps_ns and self._counters["scan.empty"] == len(self.stamps_ns):
            raise MethodError(
                f"none of the {len(self.stamps_ns)} scans has a reading between range_min and range_max; "
                f"check these limits and the unit of the ranges ({self._last_readings})"
            )

    @property
    def lidar_measures(self) -> dict[str, object]:
        """Scans of each lidar, the fraction of them that was matched, and their median inlier ratio."""
        lidars, found = np.array(self._lidars), {}
        matched = np.array([match.is_matched for match in self._matches])
        for lidar in sorted(set(self._lidars)):
            own = lidars == lidar
            found[lidar] = {
                "scans": int(own.sum()),
                "matched_ratio": round(float(matched[own].mean()), 4),
                "median_inlier_ratio": round(float(np.median(self.inlier_ratios[own])), 4),
            }
        return dict(found)

    @property
    def motion_doubt(self) -> str | None:
        """The reason, in words, to distrust a path that no other passage confirms; None without one."""
        return self._predictor.doubt or self._gaps.doubt

    @property
    def sensor_doubt(self) -> str | None:
        """The reason, in words, to distrust the map of a robot that sways, or of walls that leave its motion open."""
        return (self.sway and self.sway.doubt) or self._open_stretches.doubt

    def open_ns(self) -> NDArray[np.int64]:
        """First and last stamps `(k, 2)` of the parts of the path on which the scans do not show how far the robot moved."""
        leave_open = np.array([is_open(match) for match in self._matches], np.bool_)
        return stretches(np.array(self.stamps_ns, np.int64), leave_open)

    @property
    def inlier_ratios(self) -> Floats:
        """The fraction `(n,)` of each scan's points that lay on a surface of the local map."""
        return np.array([match.inlier_ratio for match in self._matches])

    @property
    def key_slips_m2(self) -> Floats:
        """Variances `(k, 2)` along x and y of each key scan's step, by which it may have slipped without odometry."""
        sums = np.cumsum(np.concatenate([np.zeros((1, 2)), np.reshape(self._slips_m2, (-1, 2))]), axis=0)
        ends = np.array([0, *(key + 1 for key in self.keys)], np.int64)
        return np.asarray(np.diff(sums[ends], axis=0))

    def unmatched_ns(self) -> NDArray[np.int64]:
        """First and last stamps `(k, 2)` of the parts of the path that rest on odometry alone."""
        unmatched = np.array([not match.is_matched for match in self._matches], np.bool_)
        return stretches(np.array(self.stamps_ns, np.int64), unmatched)

    def process(self, event: Event) -> Iterator[PlacedScan]:
        """Take in odometry, yaw rates, a scan or extrinsics; yields the scans that need not wait for odometry any more."""
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
        """The lidar's pose in the robot's frame; the origin if the log has no extrinsics of it."""
        return self.sensor_extrinsics.get(scan.frame_id, LidarExtrinsics(np.zeros(3)))

    def _is_flipped(self, frame_id: str) -> bool:
        extrinsics = self.sensor_extrinsics.get(frame_id)
        return extrinsics is not None and extrinsics.flipped

    def twist(self, placed: PlacedScan) -> Floats:
        """Velocity (vx, vy, wz) `(3,)` since the last tracked scan: by odometry, or as predicted where there is none."""
        if self.known_twist is not None:
            return self.known_twist(placed.scan.stamp_ns)
        return self._predictor.twist(placed)

    def prepare(self, placed: PlacedScan) -> PreparedScan:
        """The scan's points, with the robot's motion during the sweep removed."""
        scan = placed.scan
        prepared = prepare_scan(scan, self.lidar_extrinsics(scan), self.twist(placed), self._scan_config)
        if not len(prepared.points):
            self._counters["scan.empty"] += 1
            self._last_readings = _readings_in_words(scan)
        return prepared

    def track(self, placed: PlacedScan, scan: PreparedScan) -> ScanMatch:
        """Match the scan and append its pose to the path."""
        motion = self._predictor.predict(placed)
        match = self._front_end.track(scan, motion.odometry, motion.min_std)
        self._counters["scan.unmatched"] += not match.is_matched
        self._lidar = lidar_of(placed.scan)
        self._lidars.append(self._lidar)
        self._slips_m2.append(self._slip_m2(placed, match))
        if len(self.stamps_ns) > 1 and not self._predictor.uses_odometry(placed):
            self._gaps.add((scan.stamp_ns - self.stamps_ns[-1]) * 1e-9, self._last_speed_mps, match)
        if self.stamps_ns:
            travel_m = math.hypot(*se2.between(self.pose, match.pose)[:2].tolist())
            elapsed_s = max((scan.stamp_ns - self.stamps_ns[-1]) * 1e-9, 0.0)
            self._open_stretches.add(travel_m, elapsed_s, match, self._predictor.uses_odometry(placed))
        self.stamps_ns.append(scan.stamp_ns)
        self.track_poses.append(self._front_end.pose.copy())
        self._matches.append(match)
        is_certain = match.is_matched and match.position_std_m < FIRM_STD_M
        is_compared = is_certain and self._predictor.uses_odometry(placed)
        self._sway_observer.add_scan(placed.odometry, placed.odometry_jumped, is_compared)
        height_m = self._level_heights_m.get(placed.scan.frame_id, math.nan)
        self._heights_m.append(math.nan if placed.scan.is_of_cloud else height_m)
        self._predictor.add_match(placed, match)
        return match

    @property
    def _last_speed_mps(self) -> float:
        """The speed between the last two tracked scans; there must be two."""
        elapsed_s = max((self.stamps_ns[-1] - self.stamps_ns[-2]) * 1e-9, MIN_TWIST_S)
        return math.hypot(*se2.between(*self.track_poses[-2:])[:2].tolist()) / elapsed_s

    def _slip_m2(self, placed: PlacedScan, match: ScanMatch) -> Floats:
        """Variances `(2,)` along x and y by which the step to a scan may have slipped: none where there is odometry."""
        if self._predictor.uses_odometry(placed) or not self.stamps_ns:
            return NO_SLIP_M2
        elapsed_s = (placed.scan.stamp_ns - self.stamps_ns[-1]) * 1e-9
        return slip_variances(se2.between(self.pose, match.pose), elapsed_s, match)

    def track_scan(self, placed: PlacedScan) -> PreparedScan:
        """Prepare and track a scan, and make it a key scan when one is due."""
        scan = self.prepare(placed)
        self.track(placed, scan)
        if self.is_key_scan_due:
            self.add_key_scan(scan)
        return scan

    def track_all(self, events: Iterable[Event]) -> Trajectory:
        """Track the scans among events, and those that waited; returns the path over all scans so far in the map frame."""
        for placed in chain(chain.from_iterable(map(self.process, events)), self.flush()):
            self.track_scan(placed)
        return Trajectory(np.array(self.stamps_ns, np.int64), np.array(self.track_poses).reshape(-1, 3))

    @property
    def is_key_scan_due(self) -> bool:
        """Whether the last scan is far enough from the last key scan of its lidar; the first scan always is."""
        last = self._last_key_of.get(self._lidar)
        return last is None or self._spacing.is_due(self.track_poses[last], self.pose)

    def add_key_scan(self, scan: PreparedScan) -> Floats:
        """Make the last tracked scan a key scan; returns the motion `(3,)` since the previous key scan, zero for the first."""
        step = se2.between(self.track_poses[self.keys[-1]], self.pose) if self.keys else np.zeros(3)
        self._front_end.add_key_scan(scan)
        self.keys.append(len(self.track_poses) - 1)
        self._last_key_of[self._lidar] = self.keys[-1]
        self.key_scans.append(scan)
        return step

    def remove_sway(self) -> None:
        """Find the sway of the robot after the last scan; level the key scans by it where the heights of all lidars are known."""
        self.sway = self._sway_observer.sway_of(
            np.array(self.stamps_ns, np.int64), np.array(self.track_poses)
        )
        heights_m = np.array(self._heights_m)[self.keys]
        if self.sway is None or not (heights_m >= MIN_HEIGHT_M).all():
            return
        self.sway = replace(self.sway, is_levelled=True)
        swung, self.key_scans = self.key_scans, PackedScans()
        for row, scan, height_m in zip(self.keys, swung, heights_m.tolist(), strict=True):
            self.key_scans.append(levelled(scan, self.sway.shifts_m[row], height_m))

    def corrected(self, key_poses: Floats) -> Trajectory:
        """The path over all scans, given the final poses `(k, 3)` of the key scans; without the robot's sway."""
        poses = distribute_corrections(np.array(self.track_poses), np.array(self.keys, np.int64), key_poses)
        if self.sway is not None:
            poses = self.sway.removed_from(poses)
        return Trajectory(np.array(self.stamps_ns, np.int64), poses)


def _readings_in_words(scan: LaserScan) -> str:
    """The readings of a scan without usable ones, in words."""
    readings = scan.ranges_m[np.isfinite(scan.ranges_m)]
    if not len(readings):
        return "one holds no number; a point cloud has no return in the band of log.cloud then"
    return (
        f"one holds {float(readings.min()):.3g} to {float(readings.max()):.3g} m, and says {scan.range_min_m:.3g} to "
        f"{scan.range_max_m:.3g} m"
    )
