"""Removes stale scans: copies of the last scan that a driver or a relay sends while the robot drives on."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry
from gridslam.lidar_slam.scan_tracker import lidar_of

Floats = NDArray[np.float64]

# Scans with fewer readings may be alike without being copies: nothing is in view
MIN_READINGS = 20
# Smallest motion by odometry since a scan, and its mean speed, by which the robot moves: encoders of a robot that stands add
# nothing, and filters of several sensors drift by less
MIN_MOTION_M, MIN_MOTION_RAD = 0.004, 0.004
MIN_SPEED_MPS, MIN_SPEED_RADPS = 0.02, 0.02
MAX_ODOMETRY_GAP_S = 1.0  # between odometry farther apart the scans show whether the robot moves
KEPT_ODOMETRY = 400  # covers the time between two scans
# Without odometry the robot has moved where the next other scan differs by more than the last gap explains, at the speeds before
# and after: by twice as much if there is one repeat
MIN_CHANGE_RATIO, MIN_CHANGE_M = 1.3, 0.01
MAX_CHANGE_M = 0.5  # a reading that changes by more has met another thing
# Number of repeats at the end of a log, on which nothing decides, from which on a line names them
MIN_LAST_REPEATS = 10
# Largest number of repeats that wait until it is known whether the robot moves; bounds memory
MAX_HELD_SCANS = 3000


@dataclass(slots=True)
class _Held:
    """An event that waits, with its stamp; `is_used` is None as long as it is unknown whether a scan is stale."""

    event: Event
    is_used: bool | None = True


@dataclass(slots=True)
class _Run:
    """A scan that differs from the one before, and its repeats. `odometry` `(3,)`: the pose at the scan, once known."""

    scan: LaserScan
    previous: _Run | None = None
    repeats: list[_Held] = field(default_factory=list)
    odometry: Floats | None = None

    @property
    def undecided(self) -> list[_Held]:
        """The repeats that may be stale."""
        return [held for held in self.repeats if held.is_used is None]

    def speed_to(self, scan: LaserScan) -> float:
        """Mean change of the readings (m/s) from this scan to a later one; 0 if that is not later."""
        elapsed_s = (scan.stamp_ns - self.scan.stamp_ns) * 1e-9
        return _change_m(self.scan, scan) / elapsed_s if elapsed_s > 0.0 else 0.0


class StaleScans:
    """Passes on the events of a log without stale scans. Events after a repeat wait until it is known whether it is stale.

    A noiseless lidar on a standing robot repeats its scans as well; those repeats are kept.
    """

    def __init__(self) -> None:
        self._runs: dict[str, _Run] = {}  # the last of each lidar
        self._held: deque[_Held] = deque()
        self._waiting = 0  # repeats among them
        self._odometry: deque[Odometry] = deque(maxlen=KEPT_ODOMETRY)
        self._first_ns: int | None = None  # stamp of the first scan
        self._left_out: dict[str, list[int]] = {}  # stamps of each lidar's stale scans
        self._stood: set[str] = set()  # lidars with repeats of a robot that stood
        # Stamps of each lidar's repeats at the end, on which nothing decides
        self._last_repeats: dict[str, list[int]] = {}

    def process(self, event: Event) -> Iterator[Event]:
        """Process an event; yields the events that are known not to be stale."""
        held = _Held(event)
        if isinstance(event, Odometry) and event.is_finite:
            self._odometry.append(event)
            for run in self._runs.values():
                self._decide_by_odometry(run)
        elif isinstance(event, LaserScan):
            self._add(held, event)
        self._held.append(held)
        if self._waiting > MAX_HELD_SCANS:
            self._use_all()
        yield from self._known()

    def flush(self) -> Iterator[Event]:
        """The events that still wait; repeats at the end of a log without odometry stay."""
        for lidar, run in self._runs.items():
            if run.previous is not None:
                self._decide_by_scans(run.previous, run)
            self._last_repeats[lidar] = [held.event.stamp_ns for held in run.undecided]
        self._use_all()
        yield from self._known()

    @property
    def count(self) -> int:
        """Number of scans that were left out."""
        return sum(map(len, self._left_out.values()))

    @property
    def notes(self) -> list[str]:
        """One line for the user about each lidar with stale scans."""
        left_out = [
            f"{len(stamps)} scans of {lidar} are the one before to the bit, although the robot moves or with its stamp, from "
            f"{self._since_first_s(stamps[0]):.1f} s after the first scan on: left out (its driver hangs, or scans "
            "are published or recorded twice)"
            for lidar, stamps in self._left_out.items()
        ]
        hung = [
            f"the last {len(stamps)} scans of {lidar} are one again and again: if the robot did not stand, its driver hung, and "
            f"log.end_s: {self._since_first_s(stamps[0]):.1f} leaves them out"
            for lidar, stamps in self._last_repeats.items()
            if len(stamps) >= MIN_LAST_REPEATS and lidar not in self._stood
        ]
        return left_out + hung

    def _since_first_s(self, stamp_ns: int) -> float:
        return (stamp_ns - (self._first_ns or 0)) * 1e-9

    def _add(self, held: _Held, scan: LaserScan) -> None:
        """Add a scan: a repeat of its lidar's last one, or the first of a new run, which may decide on the previous run."""
        if self._first_ns is None:
            self._first_ns = scan.stamp_ns
        lidar = lidar_of(scan)
        run = self._runs.get(lidar)
        if run is not None and _is_repeat(scan, run.scan):
            last_ns = run.repeats[-1].event.stamp_ns if run.repeats else run.scan.stamp_ns
            held.is_used = False if scan.stamp_ns == last_ns else None
            run.repeats.append(held)
            self._waiting += held.is_used is None
            self._decide_by_odometry(run)
            return
        new = _Run(scan, run)
        if run is not None:
            if run.previous is not None:
                self._decide_by_scans(run.previous, run, scan)
                run.previous.previous = None
            if not run.undecided:
                run.repeats.clear()
        self._runs[lidar] = new

    def _decide_by_odometry(self, run: _Run) -> None:
        """Decide on the repeats of a run, and of the one before, that odometry has reached."""
        for one in (run, run.previous):
            if one is None or not one.undecided:
                continue
            if one.odometry is None:
                one.odometry = self._odometry_at(one.scan.stamp_ns)
            for held in one.undecided:
                pose = self._odometry_at(held.event.stamp_ns)
                if one.odometry is not None and pose is not None:
                    elapsed_s = (held.event.stamp_ns - one.scan.stamp_ns) * 1e-9
                    self._decide(held, is_stale=_moves(se2.between(one.odometry, pose), elapsed_s))

    def _decide_by_scans(self, run: _Run, following: _Run, after: LaserScan | None = None) -> None:
        """Decide on the repeats that odometry has not decided on, by the next other scan and perhaps the one after it."""
        undecided = run.undecided
        if not undecided:
            return
        speeds = [] if run.previous is None else [run.previous.speed_to(run.scan)]
        speeds += [] if after is None else [following.speed_to(after)]
        gap_s = (following.scan.stamp_ns - undecided[-1].event.stamp_ns) * 1e-9
        explained_m = MIN_CHANGE_RATIO * gap_s * float(np.mean(speeds)) if speeds else 0.0
        is_stale = _change_m(run.scan, following.scan) > max(explained_m, MIN_CHANGE_M)
        if not is_stale:
            self._stood.add(lidar_of(run.scan))
        for held in undecided:
            self._decide(held, is_stale)

    def _use_all(self) -> None:
        for held in self._held:
            if held.is_used is None:
                self._decide(held, is_stale=False)

    def _decide(self, held: _Held, is_stale: bool) -> None:
        held.is_used = not is_stale
        self._waiting -= 1

    def _known(self) -> Iterator[Event]:
        """The events up to the first one that waits, without stale scans."""
        while self._held and self._held[0].is_used is not None:
            held = self._held.popleft()
            if held.is_used:
                yield held.event
            elif isinstance(held.event, LaserScan):
                self._left_out.setdefault(lidar_of(held.event), []).append(held.event.stamp_ns)

    def _odometry_at(self, stamp_ns: int) -> Floats | None:
        """The pose `(3,)` by odometry at a stamp; None if odometry has not reached it, or has a gap."""
        later: Odometry | None = None
        for earlier in reversed(self._odometry):
            if earlier.stamp_ns > stamp_ns:
                later = earlier
                continue
            if earlier.stamp_ns == stamp_ns:
                return earlier.pose
            if later is None or later.stamp_ns - earlier.stamp_ns > MAX_ODOMETRY_GAP_S * 1e9:
                return None
            fraction = (stamp_ns - earlier.stamp_ns) / (later.stamp_ns - earlier.stamp_ns)
            return se2.interpolate(earlier.pose, later.pose, fraction)
        return None


def _is_repeat(scan: LaserScan, before: LaserScan) -> bool:
    """Whether a scan has the readings of another one to the bit, and there are enough of them to be sure."""
    readings = scan.ranges_m
    if len(readings) != len(before.ranges_m) or readings.tobytes() != before.ranges_m.tobytes():
        return False
    return int(np.count_nonzero(_is_usable(scan))) >= MIN_READINGS


def _is_usable(scan: LaserScan) -> NDArray[np.bool_]:
    """Mask `(beams,)` of the readings between the limits."""
    upper_m = scan.range_max_m if scan.range_max_m > 0.0 else np.inf
    return np.asarray((scan.ranges_m > scan.range_min_m) & (scan.ranges_m < upper_m))


def _change_m(scan: LaserScan, other: LaserScan) -> float:
    """Mean difference (m) of the readings of two scans; 0 where they have not enough in common."""
    if len(scan.ranges_m) != len(other.ranges_m):
        return 0.0
    common = _is_usable(scan) & _is_usable(other)
    if np.count_nonzero(common) < MIN_READINGS:
        return 0.0
    differences = np.abs(scan.ranges_m[common] - other.ranges_m[common])
    return float(np.minimum(differences, MAX_CHANGE_M).mean())


def _moves(motion: Floats, elapsed_s: float) -> bool:
    """Whether a motion `(3,)` by odometry over a time (s) is one of a robot that moves."""
    distance_m, angle_rad = float(np.hypot(motion[0], motion[1])), abs(float(se2.wrap_angle(motion[2])))
    drives = distance_m > max(MIN_MOTION_M, MIN_SPEED_MPS * elapsed_s)
    return drives or angle_rad > max(MIN_MOTION_RAD, MIN_SPEED_RADPS * elapsed_s)
