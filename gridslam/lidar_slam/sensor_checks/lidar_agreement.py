"""Finds lidars with another clock, mirrored beams or wrong extrinsics, by tracking each alone and comparing the paths."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import Event, Imu, LaserScan, Odometry, Transform
from gridslam.core.stamps import earlier_stamp
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of
from gridslam.lidar_slam.sensor_checks.extrinsics_calibration import moved_transform, solve_extrinsics
from gridslam.lidar_slam.sensor_checks.motion_windows import windows_of
from gridslam.lidar_slam.sensor_checks.odometry_calibration import calibrate

Floats = NDArray[np.float64]

MIN_SCANS = 60  # smallest number of scans of a lidar that is compared


@dataclass(frozen=True, slots=True)
class LidarFault:
    """Contradiction of one lidar with another: it is `lag_s` late, or its beams are mirrored, or its extrinsics are wrong.

    `moved` `(3,)`: pose, in the true base frame, of the base that its extrinsics assume; None if the extrinsics are right.
    """

    lidar: str
    other: str
    lag_s: float = 0.0
    is_mirrored: bool = False
    moved: tuple[float, float, float] | None = None

    @property
    def note(self) -> str:
        """One line for the user."""
        found = []
        if self.is_mirrored:
            found.append(
                "its beams are mirrored (log.extrinsics with roll: 3.1416 says that it hangs upside down)"
            )
        if self.lag_s:
            found.append(f"it is {abs(self.lag_s):.2f} s {'late' if self.lag_s > 0.0 else 'early'}")
        if self.moved is not None:
            x, y, yaw = self.moved
            found.append(
                f"its extrinsics are wrong by yaw {math.degrees(yaw):.0f} deg, x {x:.2f} m, y {y:.2f} m (set log.extrinsics)"
            )
        return f"the lidar {self.lidar} contradicts {self.other}: {', '.join(found)}; used corrected"

    def applied_to(self, scan: LaserScan) -> LaserScan:
        """The scan with corrected stamp and beam order; scans of other lidars unchanged."""
        if lidar_of(scan) != self.lidar:
            return scan
        scan = replace(scan, stamp_ns=earlier_stamp(scan.stamp_ns, self.lag_s))
        return mirrored(scan) if self.is_mirrored else scan

    def applied_to_transform(self, transform: Transform) -> Transform:
        """The corrected transform of the lidar; other transforms unchanged."""
        if self.moved is None or transform.child_frame_id.partition("@")[0] != self.lidar:
            return transform
        return moved_transform(transform, np.array(self.moved))


def mirrored(scan: LaserScan) -> LaserScan:
    """The scan with negated bearings: as a lidar that hangs upside down would measure it the right way up."""
    return replace(scan, angle_min_rad=-scan.angle_min_rad, angle_increment_rad=-scan.angle_increment_rad)


def find_lidar_faults(
    events: Sequence[Event], odometry: Trajectory, build_tracker: Callable[[], ScanTracker]
) -> list[LidarFault]:
    """Contradictions of lidars among the events with the one that agrees best with the odometry, or else has most scans."""
    counts = Counter(lidar_of(e) for e in events if isinstance(e, LaserScan))
    lidars = [lidar for lidar, count in counts.most_common() if count >= MIN_SCANS]
    if len(lidars) < 2:
        return []
    paths = {lidar: _path_of(lidar, events, build_tracker()) for lidar in lidars}
    if len(odometry) > 1:
        lidars.sort(key=lambda lidar: _disagreement(paths[lidar], odometry))
    first = lidars[0]
    found = [_compared(first, other, paths) for other in lidars[1:]]
    return [fault for fault in found if fault is not None]


class LidarPath(NamedTuple):
    """The path of one lidar by matching alone, and the stretches `(k, 2)` on which its scans do not show how far it moved."""

    path: Trajectory
    open_ns: NDArray[np.int64]


def _disagreement(of: LidarPath, odometry: Trajectory) -> tuple[bool, bool, float]:
    """Whether the path of a lidar is mirrored by the odometry, or that of a lidar that sits elsewhere, and its lag (s)."""
    windows = windows_of(of.path, odometry, of.open_ns)
    if windows is None:
        return True, True, 0.0
    found = calibrate(windows)
    is_misplaced = not found.mirrors_yaw and solve_extrinsics(*windows.motions(found)) is not None
    return found.mirrors_yaw, is_misplaced, abs(found.lag_s)


def _compared(first: str, other: str, paths: Mapping[str, LidarPath]) -> LidarFault | None:
    """Contradiction between the path of another lidar and that of the first one; None if they agree."""
    path, other_path = paths[first], paths[other].path
    open_ns = np.concatenate([path.open_ns, paths[other].open_ns])
    windows = windows_of(path.path, other_path, open_ns)
    if windows is None:
        return None
    found = calibrate(windows)
    by_other, by_first = windows.motions(found)
    moved = None if found.mirrors_yaw else solve_extrinsics(by_first, by_other)
    if not (found.lag_s or found.mirrors_yaw or moved is not None):
        return None
    x, y, yaw = (0.0, 0.0, 0.0) if moved is None else moved.tolist()
    return LidarFault(other, first, found.lag_s, found.mirrors_yaw, None if moved is None else (x, y, yaw))


def _path_of(lidar: str, events: Sequence[Event], tracker: ScanTracker) -> LidarPath:
    """The path over the scans of one lidar by matching alone."""
    own = (
        e
        for e in events
        if not isinstance(e, Odometry | Imu) and not (isinstance(e, LaserScan) and lidar_of(e) != lidar)
    )
    return LidarPath(tracker.track_all(own).sorted(), tracker.path.open_ns())
