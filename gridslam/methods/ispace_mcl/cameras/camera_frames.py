"""Frames of fixed cameras, and the path of the odometry that joins each to a scan."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import pose_at
from gridslam.methods.ispace_mcl.cameras.environment import CameraObservation, ObservedTrack
from gridslam.methods.ispace_mcl.cameras.tracks import TrackedObject
from gridslam.sensors.floor_cells import FloorCells

Floats = NDArray[np.float64]

_KEPT_POSES = 400


class ScanOdometry:
    """T_odom_base at the last scans, without a jump of the odometry between them."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Floats]] = deque(maxlen=_KEPT_POSES)

    @property
    def end_ns(self) -> int | None:
        """The stamp of the last scan; None without any."""
        return self._poses[-1][0] if self._poses else None

    def add(self, stamp_ns: int, odometry: Floats) -> None:
        """Add T_odom_base `(3,)` at a scan."""
        self._poses.append((stamp_ns, odometry))

    def motion_since(self, stamp_ns: int) -> Floats | None:
        """T_now_then `(3,)` of the robot at a stamp, now being the last scan; None before the first scan."""
        if not self._poses or stamp_ns < self._poses[0][0]:
            return None
        now_ns, now = self._poses[-1]
        if stamp_ns >= now_ns:
            return np.zeros(3)
        stamps, poses = [stamp for stamp, _ in self._poses], [pose for _, pose in self._poses]
        then = pose_at(stamp_ns, stamps, poses)
        return None if then is None else se2.between(now, then)


@dataclass(frozen=True, slots=True)
class CameraFrame:
    """The moving floor cells of a camera's frame, all that it sees, and the moving objects with their past.

    `streams` are those of its images: image, depth or both.
    """

    stamp_ns: int
    moving: FloorCells
    in_view: FloorCells
    objects: Sequence[TrackedObject]
    streams: Sequence[str] = ("image", "depth")

    def observation(self, path: ScanOdometry, stamp_ns: int, max_age_s: float) -> CameraObservation | None:
        """The observation for the path's last scan; None if the frame is too old or its odometry unknown."""
        T_now_then = path.motion_since(self.stamp_ns)
        if T_now_then is None or stamp_ns - self.stamp_ns > max_age_s * 1e9:
            return None
        tracks = []
        for tracked in self.objects:
            past = [(path.motion_since(past_ns), cells) for past_ns, cells in tracked.past]
            known = tuple((then, cells) for then, cells in past if then is not None)
            tracks.append(ObservedTrack(tracked.cells, known, tracked.was_expected))
        return CameraObservation(self.moving, self.in_view, T_now_then, tuple(tracks))
