"""The robot's path over all scans as the front end tracked it, and the key scans on it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory, stretches
from gridslam.graph.pose_graph import Edges
from gridslam.lidar_slam.front_end import ScanMatch
from gridslam.lidar_slam.key_scans import distribute_corrections
from gridslam.lidar_slam.motion_prediction import MIN_TWIST_S
from gridslam.lidar_slam.open_stretches import shows_distance

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class TrackedPath:
    """Stamp, pose, match and lidar of every tracked scan.

    `stamps_ns` and `poses` (T_track_base `(3,)`, in the front end's frame) have one entry per scan; `keys` are the indices of the
    key scans in them.
    """

    def __init__(self) -> None:
        self.stamps_ns: list[int] = []
        self.poses: list[Floats] = []
        self.keys: list[int] = []
        self._matches: list[ScanMatch] = []
        self._slips: list[Floats] = []
        self._lidars: list[str] = []
        self._last_key_of: dict[str, int] = {}  # index of each lidar's last key scan

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def append(self, stamp_ns: int, pose: Floats, match: ScanMatch, lidar: str, slip: Floats) -> None:
        """Add the next scan, of the named lidar.

        `slip` `(3,)` are the variances of x, y (m^2) and yaw (rad^2) by which the robot may have slipped since the scan before.
        """
        self.stamps_ns.append(stamp_ns)
        self.poses.append(pose)
        self._matches.append(match)
        self._lidars.append(lidar)
        self._slips.append(slip)

    def make_key(self) -> Floats:
        """Make the last scan a key scan; returns the motion `(3,)` since the previous key scan, zero for the first."""
        step = se2.between(self.poses[self.keys[-1]], self.pose) if self.keys else np.zeros(3)
        self.keys.append(len(self) - 1)
        self._last_key_of[self._lidars[-1]] = self.keys[-1]
        return step

    @property
    def pose(self) -> Floats:
        """T_track_base `(3,)` at the last scan; there must be one."""
        return self.poses[-1]

    @property
    def last_speed_mps(self) -> float:
        """The speed between the last two scans; there must be two."""
        elapsed_s = max((self.stamps_ns[-1] - self.stamps_ns[-2]) * 1e-9, MIN_TWIST_S)
        return math.hypot(*se2.between(*self.poses[-2:])[:2].tolist()) / elapsed_s

    @property
    def last_key_pose(self) -> Floats | None:
        """The pose `(3,)` at the last key scan of the lidar that took the last scan; None without one."""
        key = self._last_key_of.get(self._lidars[-1])
        return None if key is None else self.poses[key]

    @property
    def key_poses(self) -> Floats:
        """The front end's poses `(k, 3)` of the key scans."""
        return np.array(self.poses)[self.keys]

    @property
    def key_stamps_ns(self) -> Ints:
        """Stamps `(k,)` of the key scans."""
        return np.array(self.stamps_ns, np.int64)[self.keys]

    @property
    def key_slips(self) -> Floats:
        """Variances `(k, 3)` of x, y and yaw by which the robot may have slipped before each key scan, since the one before."""
        sums = np.cumsum(np.concatenate([np.zeros((1, 3)), np.reshape(self._slips, (-1, 3))]), axis=0)
        ends = np.array([0, *(key + 1 for key in self.keys)], np.int64)
        return np.asarray(np.diff(sums[ends], axis=0))

    @property
    def inlier_ratios(self) -> Floats:
        """The fraction `(n,)` of each scan's points that lay on a surface of the local map."""
        return np.array([match.inlier_ratio for match in self._matches])

    @property
    def lidar_measures(self) -> dict[str, object]:
        """Number of scans of each lidar, the fraction of them that was matched, and their median inlier ratio."""
        lidars, measures = np.array(self._lidars), {}
        matched = np.array([match.is_matched for match in self._matches])
        for lidar in sorted(set(self._lidars)):
            own = lidars == lidar
            measures[lidar] = {
                "scans": int(own.sum()),
                "matched_ratio": round(float(matched[own].mean()), 4),
                "median_inlier_ratio": round(float(np.median(self.inlier_ratios[own])), 4),
            }
        return dict(measures)

    def stamps_of(self, loops: Edges) -> Ints:
        """Stamps `(l, 2)` of the key scans that edges join."""
        stamps_ns = self.key_stamps_ns
        return np.stack([stamps_ns[loops.source], stamps_ns[loops.target]], axis=1)

    def unmatched_ns(self) -> Ints:
        """First and last stamps `(k, 2)` of the parts of the path that rest on odometry alone."""
        return self._stretches([not match.is_matched for match in self._matches])

    def open_ns(self) -> Ints:
        """First and last stamps `(k, 2)` of the parts of the path on which the scans do not show how far the robot moved."""
        return self._stretches([not shows_distance(match) for match in self._matches])

    def trajectory(self) -> Trajectory:
        """The path over all scans, in the front end's frame."""
        return Trajectory(np.array(self.stamps_ns, np.int64), np.array(self.poses).reshape(-1, 3))

    def corrected(self, key_poses: Floats) -> Trajectory:
        """The path over all scans, given the final poses `(k, 3)` of the key scans."""
        poses = distribute_corrections(np.array(self.poses), np.array(self.keys, np.int64), key_poses)
        return Trajectory(np.array(self.stamps_ns, np.int64), poses)

    def _stretches(self, mask: list[bool]) -> Ints:
        return stretches(np.array(self.stamps_ns, np.int64), np.array(mask, np.bool_))
