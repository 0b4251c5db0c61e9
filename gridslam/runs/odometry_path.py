"""The odometry's own path over a run, few enough poses to draw."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gridslam.core.messages import Event, Odometry
from gridslam.core.trajectory import Trajectory

MIN_STEP_M, MIN_STEP_RAD = 0.1, 0.1  # smallest motion between poses that are kept


class OdometryPath:
    """Keeps an odometry pose whenever the robot has moved since the last one that was kept."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._poses: list[tuple[float, float, float]] = []

    def add(self, events: Iterable[Event]) -> None:
        """Add the odometry among some events."""
        for event in events:
            if isinstance(event, Odometry) and self._has_moved(event):
                self._stamps.append(event.stamp_ns)
                self._poses.append((event.x_m, event.y_m, event.yaw_rad))

    def trajectory(self) -> Trajectory:
        """The kept poses in recorded order, in the odometry's frame."""
        return Trajectory(np.array(self._stamps, np.int64), np.array(self._poses).reshape(-1, 3))

    def _has_moved(self, event: Odometry) -> bool:
        if not self._poses:
            return True
        x, y, yaw = self._poses[-1]
        moved_m = max(abs(event.x_m - x), abs(event.y_m - y))
        return moved_m >= MIN_STEP_M or abs(event.yaw_rad - yaw) >= MIN_STEP_RAD
