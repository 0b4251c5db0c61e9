"""Checks whether levelling helps: the motion of a robot is even, but scans levelled by a wrong tilt make its path sway."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of

# Duration of the motions that are compared; shorter than the sway of a robot, which takes seconds
STEP_S = 0.4
MIN_STEPS = 40


class Levelling(Enum):
    """Tilt by which scans are levelled: that of the robot about its base, that of the lidar about itself, or none."""

    BASE = "robot"
    LIDAR = "lidar"
    NONE = "none"


NOTES = {
    Levelling.LIDAR: "scans are levelled about the lidar, not about the robot's base: the path is more even",
    Levelling.NONE: "the IMU's tilt is not that of the lidar: scans are not levelled, with which the path is more even",
}


@dataclass(frozen=True, slots=True)
class LevelledScans:
    """Static transforms of the lidars whose scans were levelled one by one, and the tilt to level them by."""

    extrinsics: dict[str, Transform]
    by: Levelling = Levelling.BASE

    @classmethod
    def among(cls, events: Sequence[Event]) -> LevelledScans:
        """The levelled scans among the events; the static transforms of all fixed lidars come first."""
        placed = {lidar_of(e) for e in events if isinstance(e, LaserScan) and lidar_of(e) != e.frame_id}
        return cls(
            {e.child_frame_id: e for e in events if isinstance(e, Transform) and e.child_frame_id in placed}
        )

    @property
    def note(self) -> str | None:
        """One line for the user; None if the scans are levelled as the IMU says."""
        return NOTES.get(self.by)

    def applied_to(self, event: Event) -> Event:
        """A scan levelled by the tilt `by`, or the transform that places a scan; other events unchanged."""
        if self.by is Levelling.BASE or not self.extrinsics:
            return event
        if self.by is Levelling.NONE and isinstance(event, LaserScan) and lidar_of(event) in self.extrinsics:
            return replace(event, frame_id=lidar_of(event))
        if self.by is Levelling.LIDAR and isinstance(event, Transform):
            given = self.extrinsics.get(event.child_frame_id.partition("@")[0])
            return event if given is None else replace(event, translation_m=given.translation_m)
        return event

    def decided(self, events: Sequence[Event], build_tracker: Callable[[], ScanTracker]) -> LevelledScans:
        """The same scans with the tilt that gives the most even path; with `BASE` if there are too few scans among the events."""
        if not self.extrinsics:
            return self
        uneven: dict[Levelling, float] = {}
        for by in Levelling:
            tried = replace(self, by=by)
            found = unevenness_m(_path([tried.applied_to(event) for event in events], build_tracker()))
            if found is None:
                return self
            uneven[by] = found
        return replace(self, by=min(uneven, key=lambda by: uneven[by]))


def unevenness_m(path: Trajectory) -> float | None:
    """Mean change (m) of the robot's motion from one step of STEP_S to the next; None if the path has too few steps."""
    path = path.sorted()
    first_ns, last_ns = (int(path.stamps_ns[0]), int(path.stamps_ns[-1])) if len(path) else (0, 0)
    poses, _ = path.at(np.arange(first_ns, last_ns, round(STEP_S * 1e9)))
    if len(poses) < MIN_STEPS + 2:
        return None
    motions = se2.between(poses[:-1], poses[1:])
    return float(np.hypot(*np.diff(motions[:, :2], axis=0).T).mean())


def _path(events: Sequence[Event], tracker: ScanTracker) -> Trajectory:
    """The path over scans by matching alone."""
    return tracker.track_all(event for event in events if not isinstance(event, Odometry))
