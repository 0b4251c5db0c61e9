"""The odometry of the last seconds: pose and velocity at a stamp."""

from __future__ import annotations

import bisect
from collections import deque

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Odometry
from gridslam.core.trajectory import pose_at

Floats = NDArray[np.float64]

MAX_MESSAGES = 200
MAX_INTERVAL_S = 0.5  # longest time between two messages that give a velocity


class RecentOdometry:
    """Keeps the last messages."""

    def __init__(self) -> None:
        self._poses: deque[tuple[int, Floats]] = deque(maxlen=MAX_MESSAGES)

    def __len__(self) -> int:
        return len(self._poses)

    @property
    def latest(self) -> tuple[int, Floats]:
        """Stamp and T_odom_base `(3,)` of the last message."""
        return self._poses[-1]

    def add(self, odometry: Odometry) -> None:
        """Add a message."""
        self._poses.append((odometry.stamp_ns, odometry.pose))

    def pose_at(self, stamp_ns: int) -> Floats:
        """T_odom_base `(3,)` at a stamp, interpolated; before the first and after the last message, that message's pose."""
        stamps = [stamp for stamp, _ in self._poses]
        inside_ns = min(max(stamp_ns, stamps[0]), stamps[-1])
        pose = pose_at(inside_ns, stamps, [pose for _, pose in self._poses])
        assert pose is not None  # the stamp lies within those kept
        return pose

    def twist_at(self, stamp_ns: int) -> Floats:
        """Velocity (vx, vy, wz) `(3,)` at a stamp (m/s, rad/s); 0 if it is unknown."""
        if len(self._poses) < 2:
            return np.zeros(3)
        stamps = [stamp for stamp, _ in self._poses]
        after = min(max(bisect.bisect_left(stamps, stamp_ns), 1), len(stamps) - 1)
        (t0, a), (t1, b) = self._poses[after - 1], self._poses[after]
        elapsed = (t1 - t0) * 1e-9
        return se2.between(a, b) / elapsed if 0.0 < elapsed < MAX_INTERVAL_S else np.zeros(3)
