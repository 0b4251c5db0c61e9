"""Gives every scan the odometry pose at its stamp; a scan waits until odometry has reached its stamp, or is given up."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry
from gridslam.motion.odometry_limits import OdometryLimits

Floats = NDArray[np.float64]

MAX_SCAN_GAP_S = 1.0  # no velocity is derived from scans farther apart
MAX_ODOMETRY_GAP_S = 1.0  # longer gaps are counted
MIN_CLOCK_JUMP_NS = 200_000_000  # odometry that jumps back by more is on a clock that was set back
# Longest gap that is interpolated: within longer ones scans have no odometry, if they need none
MAX_INTERPOLATED_GAP_S = 2.0
MAX_WAITING_SCANS = 1000  # bounds memory when the odometry ends before the scans


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A scan with T_odom_base `(3,)` at its stamp; `odometry_jumped` if the odometry has jumped since the previous scan.

    If the log has no odometry at the stamp, `has_odometry` is False and the pose is meaningless.
    """

    scan: LaserScan
    odometry: Floats
    odometry_jumped: bool
    has_odometry: bool = True


def twist_between(previous: PlacedScan | None, placed: PlacedScan) -> Floats:
    """Velocity (vx, vy, wz) `(3,)` by odometry since the previous scan; zero if there is none, or after a gap."""
    if previous is None or not (previous.has_odometry and placed.has_odometry):
        return np.zeros(3)
    elapsed_s = (placed.scan.stamp_ns - previous.scan.stamp_ns) * 1e-9
    if not 0.0 < elapsed_s < MAX_SCAN_GAP_S:
        return np.zeros(3)
    return np.asarray(se2.between(previous.odometry, placed.odometry) / elapsed_s)


class ScanPoses:
    """Gives each scan the odometry pose at its stamp. Scans and odometry are added in the order in which they arrive.

    A step of the odometry beyond `limits` is a restart of its frame: the jump is removed from the motion, and the next scan is
    marked with `odometry_jumped`. A scan waits for odometry at its stamp until a later scan is `max_wait_s` newer, and is then
    returned without odometry; with an infinite `max_wait_s`, the default, it is never returned without odometry.
    """

    def __init__(
        self,
        limits: OdometryLimits,
        max_waiting_scans: int = MAX_WAITING_SCANS,
        max_wait_s: float = math.inf,
    ) -> None:
        self._limits = limits
        self._max_waiting_scans = max_waiting_scans
        self._max_wait_s = max_wait_s
        self._waiting: deque[LaserScan] = deque()
        self._last: tuple[int, Floats] | None = None  # stamp and raw pose of the last odometry
        self._previous: tuple[int, Floats] | None = None  # stamp and continuous pose of the one before
        self._continuous = np.zeros(3)  # the last pose in a frame without jumps
        self._has_jumped = False
        self.counters: Counter[str] = Counter()

    def add_scan(self, scan: LaserScan) -> Iterator[PlacedScan]:
        """Add a scan; yields it at once if odometry has reached its stamp, and scans that have waited too long."""
        self._waiting.append(scan)
        if len(self._waiting) > self._max_waiting_scans:
            oldest = self._waiting.popleft()
            if math.isinf(self._max_wait_s):
                self.counters["skipped.scan.no_odometry"] += 1
            else:
                yield self._without_odometry(oldest)
        yield from self._ready()
        while self._waiting and (scan.stamp_ns - self._waiting[0].stamp_ns) * 1e-9 > self._max_wait_s:
            yield self._without_odometry(self._waiting.popleft())

    def add_odometry(self, odometry: Odometry) -> Iterator[PlacedScan]:
        """Add odometry; yields the waiting scans up to its stamp."""
        if not odometry.is_finite:
            self.counters["skipped.odom.not_finite"] += 1
            return
        pose, stamp = odometry.pose, odometry.stamp_ns
        if self._last is not None and stamp < self._last[0] - MIN_CLOCK_JUMP_NS:
            yield from self.flush()  # the clock was set back: these scans would wait until it has caught up
        if self._last is None:
            self._continuous = pose
        else:
            self._add_step(se2.between(self._last[1], pose), (stamp - self._last[0]) * 1e-9, self._last[0])
        self._last = (stamp, pose)
        yield from self._ready()

    def flush(self) -> Iterator[PlacedScan]:
        """Yields the scans after the last odometry: with its pose or, if that is too old and `max_wait_s` finite, without."""
        needs_odometry = math.isinf(self._max_wait_s)
        while self._waiting:
            scan = self._waiting.popleft()
            if self._last is not None and (needs_odometry or self._is_just_after_odometry(scan)):
                self.counters["scan.after_last_odometry"] += 1
                yield self._placed(scan, self._continuous)
            elif needs_odometry:
                self.counters["skipped.scan.no_odometry"] += 1
            else:
                yield self._without_odometry(scan)

    def _add_step(self, step: Floats, elapsed_s: float, since_ns: int) -> None:
        """Add one odometry step to the continuous pose, unless it is a jump."""
        self._previous = (since_ns, self._continuous)
        if elapsed_s > MAX_ODOMETRY_GAP_S:
            self.counters["odometry.gaps"] += 1
        x, y, yaw = step.tolist()
        if self._limits.has_jumped(math.hypot(x, y), yaw, abs(elapsed_s)):
            self.counters["odometry.jumps"] += 1
            self._has_jumped = True
        else:
            self._continuous = se2.compose(self._continuous, step)

    def _ready(self) -> Iterator[PlacedScan]:
        while self._waiting and self._last is not None and self._waiting[0].stamp_ns <= self._last[0]:
            scan = self._waiting.popleft()
            if self._is_far_from_odometry(scan.stamp_ns, self._last[0]):
                yield self._without_odometry(scan)
            else:
                yield self._placed(scan, self._pose_at(scan.stamp_ns, self._last[0]))

    def _is_far_from_odometry(self, stamp_ns: int, last_ns: int) -> bool:
        """Whether a scan lies long before the first odometry, or in a long gap, and may be placed without odometry."""
        if math.isinf(self._max_wait_s):
            return False
        if self._previous is None:
            return last_ns - stamp_ns > MAX_INTERPOLATED_GAP_S * 1e9
        gap_ns = last_ns - self._previous[0]
        return self._previous[0] < stamp_ns < last_ns and gap_ns > MAX_INTERPOLATED_GAP_S * 1e9

    def _pose_at(self, stamp_ns: int, last_ns: int) -> Floats:
        """Pose interpolated between the last two odometry poses; the nearer one for a stamp outside of them."""
        if self._previous is None:
            if stamp_ns < last_ns:
                self.counters["scan.before_first_odometry"] += 1
            return self._continuous
        previous_ns, previous = self._previous
        span_ns = last_ns - previous_ns
        if span_ns <= 0 or stamp_ns >= last_ns:
            return self._continuous
        if stamp_ns < previous_ns:
            self.counters["scan.older_than_odometry"] += 1
        fraction = max((stamp_ns - previous_ns) / span_ns, 0.0)
        return se2.interpolate(previous, self._continuous, fraction)

    def _is_just_after_odometry(self, scan: LaserScan) -> bool:
        return self._last is not None and (scan.stamp_ns - self._last[0]) * 1e-9 < MAX_SCAN_GAP_S

    def _without_odometry(self, scan: LaserScan) -> PlacedScan:
        self.counters["scan.without_odometry"] += 1
        return PlacedScan(scan, np.zeros(3), False, has_odometry=False)

    def _placed(self, scan: LaserScan, pose: Floats) -> PlacedScan:
        has_jumped, self._has_jumped = self._has_jumped, False
        return PlacedScan(scan, pose, has_jumped)
