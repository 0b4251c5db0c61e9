"""Extended Kalman filter over (x, y, yaw): motion from odometry, absolute poses from outside (stereo-bayes, paper section 1)."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import Counter
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MotionNoise:
    """Deviations of a motion, growing with the root of its length in whatever steps it comes: m after a metre, rad after a
    radian, rad after a metre.
    """

    translation_m: float
    rotation_rad: float
    rotation_per_m_rad: float

    def covariance(self, step: Floats) -> Floats:
        """Of a step `(3,)` in the robot's frame, `(3, 3)`."""
        way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        along = self.translation_m**2 * way
        return np.diag([along, along, self.rotation_rad**2 * turn + self.rotation_per_m_rad**2 * way])


@dataclass(frozen=True, slots=True)
class PoseBelief:
    """T_map_base `(3,)` with covariance `(3, 3)`."""

    pose: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, order=True)
class _Fix:
    stamp_ns: int
    number: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...]


@dataclass(slots=True)
class _Entry:
    """Odometry of a moment, and the belief after all that was known then."""

    stamp_ns: int
    odometry: Floats
    belief: PoseBelief | None
    rival: _Rival | None  # what the fixes refused in a row up to here say, as far as they agree


@dataclass(frozen=True, slots=True)
class _Rival:
    """Another belief: of so many fixes that were refused in a row and agree with each other."""

    belief: PoseBelief
    fixes: int


class AbsolutePoseFilter:
    """Takes in odometry and fixes in any order of their stamps; a late fix is put where it belongs and all after it done again.

    A fix beyond the gate is refused. When `reset_after` of them in a row agree with each other, carried along by the odometry,
    it is the filter that is wrong: it goes on from where they say. Outliers that agree with nothing never do that.
    `start` is the pose of the first odometry in the map; None waits for the first fix. Counters: used.fix, fix.resets,
    skipped.fix.<reason> (rejected: beyond the gate; too_late; not_finite; no_odometry).
    """

    def __init__(
        self, noise: MotionNoise, gate: float, window_s: float, reset_after: int, start: PoseBelief | None
    ) -> None:
        self._noise = noise
        self._gate = gate
        self._window_ns = int(window_s * 1e9)
        self._reset_after = reset_after
        self._start = start
        self._entries: list[_Entry] = []
        self._fixes: list[_Fix] = []
        self._verdicts: dict[int, tuple[str, ...]] = {}
        self._settled: Counter[str] = Counter()
        self._count = 0
        self._is_trimmed = False

    @property
    def counters(self) -> Counter[str]:
        """What became of the fixes."""
        waiting = sum(fix.number not in self._verdicts for fix in self._fixes)
        return (
            self._settled
            + Counter(chain.from_iterable(self._verdicts.values()))
            + Counter({"skipped.fix.no_odometry": waiting})
        )

    def set_noise(self, noise: MotionNoise) -> None:
        """Go by another motion from here on."""
        self._noise = noise

    def begin(self, start: PoseBelief) -> None:
        """Start here, as long as no fix has told anything else."""
        if not self._is_trimmed and self._entries and self._entries[-1].belief is None:
            self._start = start
            for k in range(len(self._entries)):
                self._advance(k)

    @property
    def is_fixed(self) -> bool:
        """Whether any fix has been used: else the map drifts with the robot, and errors of the pose are not its own."""
        return self.counters["used.fix"] > 0

    @property
    def last_stamp_ns(self) -> int | None:
        """Stamp of the latest odometry."""
        return self._entries[-1].stamp_ns if self._entries else None

    def add_odometry(self, stamp_ns: int, odometry: Floats) -> None:
        """Take in T_odom_base `(3,)`; stamps must not go back (older ones are counted and left out)."""
        if not np.isfinite(odometry).all():
            self._settled["skipped.odom.not_finite"] += 1
            return
        if self._entries and stamp_ns <= self._entries[-1].stamp_ns:
            self._settled["skipped.odom.time_back"] += 1
            return
        self._entries.append(_Entry(stamp_ns, odometry, None, None))
        self._advance(len(self._entries) - 1)
        self._forget(stamp_ns - self._window_ns)

    def add_fix(self, stamp_ns: int, pose: Floats, covariance: Floats) -> None:
        """Take in an absolute pose `(3,)` with covariance `(3, 3)`."""
        if (
            not (np.isfinite(pose).all() and np.isfinite(covariance).all())
            or np.linalg.eigvalsh(covariance)[0] <= 0
        ):
            self._settled["skipped.fix.not_finite"] += 1
            return
        if self._is_trimmed and stamp_ns <= self._entries[0].stamp_ns:
            self._settled["skipped.fix.too_late"] += 1
            return
        self._count += 1
        x, y, yaw = pose.tolist()
        insort(self._fixes, _Fix(stamp_ns, self._count, (x, y, yaw), tuple(covariance.ravel().tolist())))
        first = bisect_right([entry.stamp_ns for entry in self._entries], stamp_ns - 1)
        for k in range(first, len(self._entries)):
            self._advance(k)

    def at(self, stamp_ns: int) -> PoseBelief | None:
        """The belief at a moment within the window, between the odometry around it; None before the first fix or odometry."""
        stamps = [entry.stamp_ns for entry in self._entries]
        k = bisect_right(stamps, stamp_ns) - 1
        if k < 0:
            return None
        entry = self._entries[k]
        if entry.belief is None or k + 1 == len(self._entries):
            return entry.belief
        after = self._entries[k + 1]
        if after.belief is None:
            return entry.belief
        share = (stamp_ns - entry.stamp_ns) / (after.stamp_ns - entry.stamp_ns)
        pose = se2.interpolate(entry.belief.pose, after.belief.pose, share)
        return PoseBelief(
            np.asarray(pose), (1.0 - share) * entry.belief.covariance + share * after.belief.covariance
        )

    def _advance(self, k: int) -> None:
        """The belief of entry k: that of the one before, moved, with the fixes between them."""
        entry = self._entries[k]
        if k == 0:
            belief, rival, since, odometry = self._start, None, -(2**62), entry.odometry
        else:
            before = self._entries[k - 1]
            belief, rival, since, odometry = before.belief, before.rival, before.stamp_ns, before.odometry
        span = entry.stamp_ns - since
        low = bisect_right([fix.stamp_ns for fix in self._fixes], since)
        for fix in self._fixes[low:]:
            if fix.stamp_ns > entry.stamp_ns:
                break
            place = (
                se2.interpolate(odometry, entry.odometry, (fix.stamp_ns - since) / span) if k else odometry
            )
            belief, rival = self._moved_both(belief, rival, se2.between(odometry, place))
            odometry = np.asarray(place)
            belief, rival = self._fixed(belief, rival, fix)
        entry.belief, entry.rival = self._moved_both(belief, rival, se2.between(odometry, entry.odometry))

    def _moved_both(
        self, belief: PoseBelief | None, rival: _Rival | None, step: Floats
    ) -> tuple[PoseBelief | None, _Rival | None]:
        return (
            None if belief is None else self._moved(belief, step),
            None if rival is None else _Rival(self._moved(rival.belief, step), rival.fixes),
        )

    def _moved(self, belief: PoseBelief, step: Floats) -> PoseBelief:
        c, s = np.cos(belief.pose[2]), np.sin(belief.pose[2])
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        F = np.eye(3)
        F[:2, 2] = [-s * step[0] - c * step[1], c * step[0] - s * step[1]]
        covariance = F @ belief.covariance @ F.T + rotation @ self._noise.covariance(step) @ rotation.T
        return PoseBelief(se2.compose(belief.pose, step), covariance)

    def _fixed(
        self, belief: PoseBelief | None, rival: _Rival | None, fix: _Fix
    ) -> tuple[PoseBelief, _Rival | None]:
        """The beliefs after a fix: it is used, or strengthens the rival, or begins a new one; a strong rival takes over."""
        measured = PoseBelief(np.array(fix.pose), np.array(fix.covariance).reshape(3, 3))
        used = measured if belief is None else self._updated(belief, measured)
        if used is not None:
            self._verdicts[fix.number] = ("used.fix",)
            return used, None
        assert belief is not None
        agreed = None if rival is None else self._updated(rival.belief, measured)
        rival = _Rival(measured, 1) if rival is None or agreed is None else _Rival(agreed, rival.fixes + 1)
        if rival.fixes < self._reset_after:
            self._verdicts[fix.number] = ("skipped.fix.rejected",)
            return belief, rival
        self._verdicts[fix.number] = ("used.fix", "fix.resets")
        return rival.belief, None

    def _updated(self, belief: PoseBelief, measured: PoseBelief) -> PoseBelief | None:
        """The Kalman update by a measured pose; None where that lies beyond the gate."""
        innovation = measured.pose - belief.pose
        innovation[2] = se2.wrap_angle(innovation[2])
        S = belief.covariance + measured.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > self._gate:
            return None
        K = np.linalg.solve(S, belief.covariance).T
        pose = belief.pose + K @ innovation
        pose[2] = se2.wrap_angle(pose[2])
        left = np.eye(3) - K
        return PoseBelief(pose, left @ belief.covariance @ left.T + K @ measured.covariance @ K.T)

    def _forget(self, before_ns: int) -> None:
        """Entries older than the window cannot change any more; one of them stays to start from."""
        if self._entries[0].stamp_ns > before_ns:
            return
        stamps = [entry.stamp_ns for entry in self._entries]
        first = max(bisect_right(stamps, before_ns) - 1, 0)
        if first == 0:
            return
        self._is_trimmed = True
        keep = self._entries[first]
        for fix in [f for f in self._fixes if f.stamp_ns <= keep.stamp_ns]:
            self._settled.update(self._verdicts.pop(fix.number, ("skipped.fix.no_odometry",)))
        self._fixes = [f for f in self._fixes if f.stamp_ns > keep.stamp_ns]
        del self._entries[:first]
