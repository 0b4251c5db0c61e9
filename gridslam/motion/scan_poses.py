"""Scans wait here until odometry reaches their stamps; each leaves with the odometry pose of its moment."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Odometry

Floats = NDArray[np.float64]

LONGEST_SWEEP_GAP_S = 1.0  # between scans farther apart no velocity is derived
_GAP_S = 1.0  # longer silences of the odometry are counted


@dataclass(frozen=True, slots=True)
class PlacedScan:
    """A scan with T_odom_base `(3,)` at its stamp; `broken` when odometry jumped since the last one."""

    scan: LaserScan
    odometry: Floats
    broken: bool


def twist_between(last: PlacedScan | None, placed: PlacedScan) -> Floats:
    """Velocity (vx, vy, wz) `(3,)` by the odometry since the scan before; zero without one, or after a gap."""
    if last is None:
        return np.zeros(3)
    elapsed_s = (placed.scan.stamp_ns - last.scan.stamp_ns) * 1e-9
    if not 0.0 < elapsed_s < LONGEST_SWEEP_GAP_S:
        return np.zeros(3)
    return np.asarray(se2.between(last.odometry, placed.odometry) / elapsed_s)


class ScanPoses:
    """Joins scans and odometry in the order in which they come.

    Odometry that jumps (faster than the limits, for more than the tolerance) is taken as a restart of its frame: the jump itself
    is left out of the motion, and the next scan is marked as broken.
    """

    def __init__(
        self,
        max_speed_mps: float,
        max_turn_radps: float,
        tolerance_m: float,
        tolerance_rad: float,
        most_waiting: int = 1000,
    ) -> None:
        self._limits = (max_speed_mps, max_turn_radps, tolerance_m, tolerance_rad)
        self._most_waiting = most_waiting
        self._waiting: deque[LaserScan] = deque()
        self._last: tuple[int, Floats] | None = None  # stamp and raw pose
        self._before: tuple[int, Floats] | None = None  # stamp and joined pose of the one before
        self._joined = np.zeros(3)  # pose in a frame in which jumps are undone
        self._broken = False
        self.counters: Counter[str] = Counter()

    def add_scan(self, scan: LaserScan) -> Iterator[PlacedScan]:
        """Take in a scan; yields it at once when odometry has reached its stamp."""
        self._waiting.append(scan)
        if len(self._waiting) > self._most_waiting:
            self._waiting.popleft()
            self.counters["skipped.scan.no_odometry"] += 1
        yield from self._ready()

    def add_odometry(self, odometry: Odometry) -> Iterator[PlacedScan]:
        """Take in odometry; yields the scans that it reaches."""
        pose = odometry.pose
        if not np.isfinite(pose).all():
            self.counters["skipped.odom.not_finite"] += 1
            return
        stamp = odometry.stamp_ns
        if self._last is None:
            self._joined = pose
        else:
            step = se2.between(self._last[1], pose)
            self._before = (self._last[0], self._joined)
            elapsed = (stamp - self._last[0]) * 1e-9
            if elapsed > _GAP_S:
                self.counters["odometry.gaps"] += 1
            if self._is_jump(step, elapsed):
                self.counters["odometry.jumps"] += 1
                self._broken = True
            else:
                self._joined = se2.compose(self._joined, step)
        self._last = (stamp, pose)
        yield from self._ready()

    def flush(self) -> Iterator[PlacedScan]:
        """The scans after the last odometry, with its pose."""
        while self._waiting and self._last is not None:
            self.counters["scan.after_last_odometry"] += 1
            yield self._placed(self._waiting.popleft(), self._joined)
        self.counters["skipped.scan.no_odometry"] += len(self._waiting)
        self._waiting.clear()

    def _ready(self) -> Iterator[PlacedScan]:
        while self._waiting and self._last is not None and self._waiting[0].stamp_ns <= self._last[0]:
            scan = self._waiting.popleft()
            yield self._placed(scan, self._pose_at(scan.stamp_ns))

    def _pose_at(self, stamp_ns: int) -> Floats:
        """Pose between the last two of odometry; the nearer end for a stamp outside of them."""
        assert self._last is not None
        if self._before is None:
            if stamp_ns < self._last[0]:
                self.counters["scan.before_first_odometry"] += 1
            return self._joined
        span = self._last[0] - self._before[0]
        if span <= 0 or stamp_ns >= self._last[0]:
            return self._joined
        if stamp_ns < self._before[0]:
            self.counters["scan.older_than_odometry"] += 1
        fraction = max((stamp_ns - self._before[0]) / span, 0.0)
        return se2.interpolate(self._before[1], self._joined, fraction)

    def _placed(self, scan: LaserScan, pose: Floats) -> PlacedScan:
        broken, self._broken = self._broken, False
        return PlacedScan(scan, pose, broken)

    def _is_jump(self, step: Floats, seconds: float) -> bool:
        speed, turn_rate, tolerance_m, tolerance_rad = self._limits
        elapsed = max(abs(seconds), 0.0)
        too_far = float(np.hypot(step[0], step[1])) > tolerance_m + speed * elapsed
        return too_far or abs(float(step[2])) > tolerance_rad + turn_rate * elapsed
