"""Finds duration and direction of a lidar's sweep, for drivers that do not state them or state them wrongly.

While the robot turns, scans match best when its motion is undone with the true times of their beams.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, as_float32
from gridslam.lidar_slam.scan_tracker import ScanTracker, lidar_of

Floats = NDArray[np.float64]

# Smallest yaw rate of scans that are compared: slower rotation hardly distorts a scan
MIN_YAW_RATE_RADPS = 0.3
MIN_TURNING_SCANS = 40
# Of the period; the others only where the first is better than no motion
FIRST_FRACTION, FRACTIONS = 0.25, (0.5, 0.75, 1.0)
GRID: Floats = np.array([0.0, FIRST_FRACTION, *FRACTIONS])
PARTS = 10  # parts of the scans, each left out once
CORRELATED_SCANS = 4  # neighbours match well or badly together
MIN_Z_SCORE = 2.5  # smallest advantage of the better match, in standard deviations of its mean
MIN_GAIN = 0.005  # smallest gain of the mean inlier ratio
MAX_SWEEP_PERIODS = 1.02
MIN_TIME_ERROR = 0.3  # smallest error of a stated time, relative: rotations show it no better
# Largest difference of a lag from the time of a sweep: fraction of it, and s
MAX_END_FRACTION, MIN_END_TOLERANCE_S = 0.2, 0.015


@dataclass(frozen=True, slots=True)
class SweepTime:
    """Time (s) from the first to the last beam of a scan; negative if the last beam is measured first."""

    sweep_s: float
    stated_s: float

    @property
    def note(self) -> str:
        """One line for the user."""
        order = "" if self.sweep_s > 0.0 else ", the last beam first"
        states = f"state {self.stated_s:.3f} s" if self.stated_s else "say nothing of the time of their beams"
        return (
            f"the scans {states}: by the robot's turns a sweep takes {abs(self.sweep_s):.3f} s{order}; used to undo motion "
            "within a scan"
        )

    def applied_to(self, scan: LaserScan) -> LaserScan:
        """The scan with this time."""
        return with_sweep(scan, self.sweep_s)


def stated_sweep_s(scans: Sequence[LaserScan]) -> float:
    """The time (s) from the first to the last beam by the scans' messages; 0 if they do not state it."""
    return float(np.median([s.time_increment_s * (len(s.ranges_m) - 1) for s in scans]))


def stamped_at_end(lag_s: float, sweep_s: float) -> bool:
    """Whether odometry that is `lag_s` late shows scans whose stamps are those of their last beam.

    Stamps of odometry before its motion cannot be, but many drivers stamp a sweep when it is complete.
    """
    return lag_s < 0.0 < sweep_s and abs(lag_s + sweep_s) <= max(
        MAX_END_FRACTION * sweep_s, MIN_END_TOLERANCE_S
    )


def with_sweep(scan: LaserScan, sweep_s: float) -> LaserScan:
    """The scan with another time of its sweep (s)."""
    return replace(scan, time_increment_s=as_float32(sweep_s / max(len(scan.ranges_m) - 1, 1)))


def find_sweep_time(
    events: Sequence[Event], tracker: ScanTracker, build_tracker: Callable[[], ScanTracker]
) -> SweepTime | None:
    """The time of a sweep; None if the scans' own is as good, or nothing is certain.

    `events` are scans and extrinsics; `tracker` has followed the robot over the scans with the times that they state.
    """
    scans = [e for e in events if isinstance(e, LaserScan)]
    if (
        len({(lidar_of(s), s.time_increment_s == 0.0) for s in scans}) != 1
        or len(tracker.path.stamps_ns) < MIN_TURNING_SCANS
    ):
        return None
    steps_s = np.diff(_times_s(tracker))
    period_s = float(np.median(steps_s))
    if not period_s > 0.0 or (steps_s <= 0.0).any():
        return None
    stated_s = stated_sweep_s(scans)
    events = [e for e in events if not isinstance(e, Odometry)]
    if stated_s:  # times that may be wrong have distorted the path
        tracker = build_tracker()
        _track(tracker, events, 0.0)
    trials = _Trials(events, tracker, build_tracker)
    if len(trials.turning) < MIN_TURNING_SCANS:
        return None
    best_s = _other_than_stated(trials, stated_s, period_s) if stated_s else _best_fraction(trials, period_s)
    if best_s is None:
        return None
    gain = trials.ratios(best_s) - trials.ratios(stated_s)
    z_score = gain.mean() / max(float(gain.std()), 1e-9) * np.sqrt(len(gain) / CORRELATED_SCANS)
    # A time of the same sign lies on one curve with the stated one; the other direction is judged by the scans alone.
    is_certain = z_score > MIN_Z_SCORE or (
        best_s * stated_s > 0.0
        and abs(best_s - stated_s) > MIN_Z_SCORE * _best_fraction_std(trials, period_s, best_s)
    )
    is_usable = gain.mean() > MIN_GAIN and abs(best_s) <= MAX_SWEEP_PERIODS * period_s
    return SweepTime(best_s, stated_s) if is_certain and is_usable else None


def _track(tracker: ScanTracker, events: Sequence[Event], sweep_s: float) -> None:
    """Track scans whose sweep takes this time (s)."""
    tracker.track_all(with_sweep(e, sweep_s) if isinstance(e, LaserScan) else e for e in events)


def _other_than_stated(trials: _Trials, stated_s: float, period_s: float) -> float | None:
    """A time of a sweep (s) with which scans may match better than with the stated one; None if that is near the best."""
    none, half, stated = (float(trials.ratios(f * stated_s).mean()) for f in (0.0, 0.5, 1.0))
    if max(none, half, stated) - min(none, half, stated) < MIN_GAIN:
        return None
    if none >= max(half, stated):
        if trials.ratios(-stated_s).mean() <= none:
            return None
        found = _best_fraction(trials, period_s)
        is_other = found is not None and abs(found / -stated_s - 1.0) > MIN_TIME_ERROR
        return found if is_other else -stated_s
    curvature = none - 2.0 * half + stated  # of a parabola through the three
    best = 0.5 + 0.25 * (none - stated) / curvature if curvature < 0.0 else np.inf
    if 1.0 - MIN_TIME_ERROR < best < 1.0 + MIN_TIME_ERROR:
        return None
    found = _best_fraction(trials, period_s)
    return found if found is not None and abs(found / stated_s - 1.0) > MIN_TIME_ERROR else None


def _best_fraction(trials: _Trials, period_s: float) -> float | None:
    """The time of a sweep (s) with which scans match best, interpolated; None if no motion within a scan is as good."""
    means = {f: float(trials.ratios(f * period_s).mean()) for f in (-FIRST_FRACTION, 0.0, FIRST_FRACTION)}
    sign = 1.0 if means[FIRST_FRACTION] > means[-FIRST_FRACTION] else -1.0
    if means[sign * FIRST_FRACTION] <= means[0.0]:
        return None
    best = _vertex(_curve(trials, sign * period_s).mean(axis=1))
    return sign * best * period_s if best > 0.0 else None


def _best_fraction_std(trials: _Trials, period_s: float, best_s: float) -> float:
    """Standard deviation (s) of the best time of a sweep, by leaving out each of some parts of the scans (jackknife)."""
    curve = _curve(trials, math.copysign(period_s, best_s))
    parts = np.array_split(np.arange(curve.shape[1]), PARTS)
    found = [_vertex(np.delete(curve, part, axis=1).mean(axis=1)) for part in parts]
    return period_s * float(np.std(found)) * math.sqrt(PARTS - 1)


def _curve(trials: _Trials, period_s: float) -> Floats:
    """Inlier ratios `(f, k)` of the turning scans with each time of a sweep of `GRID`; negative: the last beam is first."""
    return np.array([trials.ratios(fraction * period_s) for fraction in GRID])


def _vertex(values: Floats) -> float:
    """The fraction from 0 to 1 at which a parabola through values `(f,)` at those of `GRID` is largest."""
    fine = np.linspace(0.0, 1.0, 101)
    return float(fine[int(np.argmax(np.polynomial.Polynomial.fit(GRID, values, 2)(fine)))])


def _times_s(tracker: ScanTracker) -> Floats:
    """Times `(n,)` of the tracked scans (s), from the first."""
    stamps_ns = np.array(tracker.path.stamps_ns, np.int64)
    return np.asarray((stamps_ns - stamps_ns[0]) * 1e-9)


class _Trials:
    """Inlier ratios of the turning scans with several times of a sweep."""

    def __init__(
        self, events: Sequence[Event], at_once: ScanTracker, build_tracker: Callable[[], ScanTracker]
    ) -> None:
        """`at_once` has followed the scans as if all beams of one were taken at once."""
        self._events = events
        self._build_tracker = build_tracker
        times_s = _times_s(at_once)
        self._origin_ns = at_once.path.stamps_ns[0]
        self._middles_s = 0.5 * (times_s[1:] + times_s[:-1])
        poses = np.array(at_once.path.poses)
        self._twists = se2.between(poses[:-1], poses[1:]) / np.diff(times_s)[:, None]
        self.turning = np.flatnonzero(np.abs(self._twists[:, 2]) > MIN_YAW_RATE_RADPS) + 1
        self._found = {0.0: at_once.path.inlier_ratios[self.turning]}

    def ratios(self, sweep_s: float) -> Floats:
        """Inlier ratios `(k,)` of the turning scans, with the robot's motion undone over this time of a sweep (s)."""
        if sweep_s not in self._found:
            self._found[sweep_s] = self._tracked(sweep_s)[self.turning]
        return self._found[sweep_s]

    def _tracked(self, sweep_s: float) -> Floats:
        tracker = self._build_tracker()
        tracker.known_twist = lambda stamp_ns: self._twist(stamp_ns, 0.5 * sweep_s)
        _track(tracker, self._events, sweep_s)
        return tracker.path.inlier_ratios

    def _twist(self, stamp_ns: int, later_s: float) -> Floats:
        at = (stamp_ns - self._origin_ns) * 1e-9 + later_s
        return np.array([np.interp(at, self._middles_s, column) for column in self._twists.T])
