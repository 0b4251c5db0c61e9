"""Checks whether odometry agrees with the scans in windows of half a second; with dead wheels or a lifted robot it does not."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

WINDOW_S = 0.5  # motions are compared over this long: matching is exact to some millimetres a scan
KEPT_WINDOWS = 12
METRES_PER_RAD = 0.5  # a rotation counts as this motion
MIN_MOTION_M = 0.1  # smallest motion of a window, by matching: slower ones show nothing
MIN_MOVING_WINDOWS = 6
# Difference of all windows relative to their motion: beyond the first odometry is left aside, below the second it is used again.
MAX_ERROR, MAX_ERROR_AGAIN = 0.5, 0.25


class OdometryTrust:
    """Compares odometry with matched scans, but only where matching is certain in all directions, unlike in a corridor."""

    def __init__(self) -> None:
        self.is_trusted = True
        self.left_aside = 0  # number of scans
        self._start: tuple[int, Floats, Floats] | None = None  # stamp, odometry and matched pose
        self._windows: deque[tuple[float, float]] = deque(maxlen=KEPT_WINDOWS)  # difference, motion (m)

    def count(self) -> None:
        """Count a scan whose odometry is left aside."""
        self.left_aside += 1

    def add(self, stamp_ns: int, odometry: Floats | None, matched: Floats, is_firm: bool) -> None:
        """Add a scan's pose `(3,)` by odometry, None if there is none or it jumped, and by matching."""
        if odometry is None or not is_firm:
            self._start = None
            return
        if self._start is None or stamp_ns < self._start[0]:
            self._start = stamp_ns, odometry, matched
            return
        start_ns, first_odometry, first_matched = self._start
        if stamp_ns - start_ns < WINDOW_S * 1e9:
            return
        self._start = stamp_ns, odometry, matched
        moved = se2.between(first_matched, matched)
        motion = _size(moved)
        if motion >= MIN_MOTION_M:
            self._windows.append((_size(se2.between(first_odometry, odometry) - moved), motion))
            self._decide()

    def _decide(self) -> None:
        if len(self._windows) < MIN_MOVING_WINDOWS:
            return
        difference, motion = (sum(values) for values in zip(*self._windows, strict=True))
        self.is_trusted = difference <= (MAX_ERROR if self.is_trusted else MAX_ERROR_AGAIN) * motion

    @property
    def note(self) -> str | None:
        """One line for the user; None for good odometry."""
        if not self.left_aside:
            return None
        return (
            f"odometry contradicts the scans: it is off by more than {MAX_ERROR:.0%} of the robot's motion, and was left aside "
            f"for {self.left_aside} scans"
        )


def _size(motion: Floats) -> float:
    """A motion `(3,)` in metres, rotation included."""
    x, y, yaw = motion.tolist()
    return float(np.hypot(x, y) + METRES_PER_RAD * abs(np.remainder(yaw + np.pi, 2.0 * np.pi) - np.pi))
