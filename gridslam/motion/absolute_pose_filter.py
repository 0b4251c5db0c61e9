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

_BEFORE_ALL_NS = -(2**62)


@dataclass(frozen=True, slots=True)
class RootMotionNoise:
    """Standard deviations that grow with the root of the motion: m after a metre, rad after a radian, rad after a metre."""

    translation_m: float
    rotation_rad: float
    rotation_per_m_rad: float

    def covariance(self, step: Floats) -> Floats:
        """Covariance `(3, 3)` of a step `(3,)` in the robot's frame."""
        distance, rotation = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        along = self.translation_m**2 * distance
        yaw = self.rotation_rad**2 * rotation + self.rotation_per_m_rad**2 * distance
        return np.diag([along, along, yaw])


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """Rejection of absolute poses.

    `gate` is the largest squared Mahalanobis distance of an inlier (chi-square 0.99, 3 degrees of freedom). Absolute poses that
    arrive more than `window_s` after their stamp are rejected. After `reset_after` consecutive rejected poses that agree with
    each other the filter restarts from them.
    """

    gate: float = 11.345
    window_s: float = 10.0
    reset_after: int = 10


@dataclass(frozen=True, slots=True)
class PoseBelief:
    """T_map_base `(3,)` with covariance `(3, 3)`."""

    pose: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, order=True)
class _Measurement:
    """An absolute pose; `number` is that of its arrival."""

    stamp_ns: int
    number: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class _Alternative:
    """A second belief, from `count` consecutive rejected absolute poses that agree with each other."""

    belief: PoseBelief
    count: int


@dataclass(slots=True)
class _OdometryState:
    """Odometry at a stamp, the belief after everything up to it, and the alternative."""

    stamp_ns: int
    odometry: Floats
    belief: PoseBelief | None
    alternative: _Alternative | None


class AbsolutePoseFilter:
    """Processes odometry and absolute poses in the order of their stamps.

    An absolute pose that arrives late is inserted at its stamp, and everything after it is computed again. One beyond the gate is
    rejected. Consecutive rejected poses that agree with each other, carried along by the odometry, are an alternative belief that
    replaces the filter's after `reset_after` of them; outliers that disagree never do. `start` is the pose of the first odometry
    in the map; with None the filter starts at the first absolute pose. Counters: used.pose, pose.resets, skipped.pose.<reason>
    (rejected: beyond the gate; too_late; not_finite; no_odometry).
    """

    def __init__(self, noise: RootMotionNoise, settings: FilterSettings, start: PoseBelief | None) -> None:
        self._noise = noise
        self._gate = settings.gate
        self._window_ns = int(settings.window_s * 1e9)
        self._reset_after = settings.reset_after
        self._start = start
        self._states: list[_OdometryState] = []
        self._measurements: list[_Measurement] = []
        self._verdicts: dict[int, tuple[str, ...]] = {}  # counters by number of the measurement
        self._final_counters: Counter[str] = Counter()
        self._count = 0
        self._is_trimmed = False

    @property
    def counters(self) -> Counter[str]:
        """Number of absolute poses used, and skipped by reason."""
        waiting = sum(measured.number not in self._verdicts for measured in self._measurements)
        return (
            self._final_counters
            + Counter(chain.from_iterable(self._verdicts.values()))
            + Counter({"skipped.pose.no_odometry": waiting})
        )

    def set_noise(self, noise: RootMotionNoise) -> None:
        """Use another motion noise from now on."""
        self._noise = noise

    def start_at(self, start: PoseBelief) -> None:
        """Initialise here unless an absolute pose has been accepted already."""
        if not self._is_trimmed and self._states and self._states[-1].belief is None:
            self._start = start
            for k in range(len(self._states)):
                self._advance(k)

    @property
    def is_absolute(self) -> bool:
        """Whether any absolute pose has been used; else the map drifts with the robot."""
        return self.counters["used.pose"] > 0

    @property
    def last_stamp_ns(self) -> int | None:
        """Stamp of the latest odometry."""
        return self._states[-1].stamp_ns if self._states else None

    def add_odometry(self, stamp_ns: int, odometry: Floats) -> None:
        """Add T_odom_base `(3,)`; stamps must increase (others are counted and skipped)."""
        if not np.isfinite(odometry).all():
            self._final_counters["skipped.odom.not_finite"] += 1
            return
        if self._states and stamp_ns <= self._states[-1].stamp_ns:
            self._final_counters["skipped.odom.out_of_order"] += 1
            return
        self._states.append(_OdometryState(stamp_ns, odometry, None, None))
        self._advance(len(self._states) - 1)
        self._trim(stamp_ns - self._window_ns)

    def add_absolute_pose(self, stamp_ns: int, pose: Floats, covariance: Floats) -> None:
        """Add a measured T_map_base `(3,)` with covariance `(3, 3)`."""
        is_finite = np.isfinite(pose).all() and np.isfinite(covariance).all()
        if not is_finite or np.linalg.eigvalsh(covariance)[0] <= 0:
            self._final_counters["skipped.pose.not_finite"] += 1
            return
        if self._is_trimmed and stamp_ns <= self._states[0].stamp_ns:
            self._final_counters["skipped.pose.too_late"] += 1
            return
        self._count += 1
        x, y, yaw = pose.tolist()
        measured = _Measurement(stamp_ns, self._count, (x, y, yaw), tuple(covariance.ravel().tolist()))
        insort(self._measurements, measured)
        first = bisect_right([state.stamp_ns for state in self._states], stamp_ns - 1)
        for k in range(first, len(self._states)):
            self._advance(k)

    def at(self, stamp_ns: int) -> PoseBelief | None:
        """The belief at a stamp in the window, interpolated between odometry; None before the first pose is known."""
        stamps = [state.stamp_ns for state in self._states]
        k = bisect_right(stamps, stamp_ns) - 1
        if k < 0:
            return None
        state = self._states[k]
        if state.belief is None or k + 1 == len(self._states):
            return state.belief
        after = self._states[k + 1]
        if after.belief is None:
            return state.belief
        fraction = (stamp_ns - state.stamp_ns) / (after.stamp_ns - state.stamp_ns)
        pose = se2.interpolate(state.belief.pose, after.belief.pose, fraction)
        return PoseBelief(
            np.asarray(pose), (1.0 - fraction) * state.belief.covariance + fraction * after.belief.covariance
        )

    def _advance(self, k: int) -> None:
        """Compute the belief of state k from that of the state before, with the absolute poses between them."""
        state = self._states[k]
        if k == 0:
            belief, alternative, since, odometry = self._start, None, _BEFORE_ALL_NS, state.odometry
        else:
            before = self._states[k - 1]
            belief, alternative = before.belief, before.alternative
            since, odometry = before.stamp_ns, before.odometry
        span = state.stamp_ns - since
        low = bisect_right([measured.stamp_ns for measured in self._measurements], since)
        for measured in self._measurements[low:]:
            if measured.stamp_ns > state.stamp_ns:
                break
            between = odometry
            if k:
                fraction = (measured.stamp_ns - since) / span
                between = np.asarray(se2.interpolate(odometry, state.odometry, fraction))
            belief, alternative = self._predict_both(belief, alternative, se2.between(odometry, between))
            odometry = between
            belief, alternative = self._update_both(belief, alternative, measured)
        step = se2.between(odometry, state.odometry)
        state.belief, state.alternative = self._predict_both(belief, alternative, step)

    def _predict_both(
        self, belief: PoseBelief | None, alternative: _Alternative | None, step: Floats
    ) -> tuple[PoseBelief | None, _Alternative | None]:
        return (
            None if belief is None else self._predict(belief, step),
            None
            if alternative is None
            else _Alternative(self._predict(alternative.belief, step), alternative.count),
        )

    def _predict(self, belief: PoseBelief, step: Floats) -> PoseBelief:
        """The belief after a step `(3,)` in the robot's frame."""
        c, s = np.cos(belief.pose[2]), np.sin(belief.pose[2])
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        F = np.eye(3)
        F[:2, 2] = [-s * step[0] - c * step[1], c * step[0] - s * step[1]]
        covariance = F @ belief.covariance @ F.T + rotation @ self._noise.covariance(step) @ rotation.T
        return PoseBelief(se2.compose(belief.pose, step), covariance)

    def _update_both(
        self, belief: PoseBelief | None, alternative: _Alternative | None, measured: _Measurement
    ) -> tuple[PoseBelief, _Alternative | None]:
        """Both beliefs after an absolute pose, which updates the first of them that it agrees with."""
        measurement = PoseBelief(np.array(measured.pose), np.array(measured.covariance).reshape(3, 3))
        updated = measurement if belief is None else self._update(belief, measurement)
        if updated is not None:
            self._verdicts[measured.number] = ("used.pose",)
            return updated, None
        assert belief is not None
        agreeing = None if alternative is None else self._update(alternative.belief, measurement)
        if alternative is None or agreeing is None:
            alternative = _Alternative(measurement, 1)
        else:
            alternative = _Alternative(agreeing, alternative.count + 1)
        if alternative.count < self._reset_after:
            self._verdicts[measured.number] = ("skipped.pose.rejected",)
            return belief, alternative
        self._verdicts[measured.number] = ("used.pose", "pose.resets")
        return alternative.belief, None

    def _update(self, belief: PoseBelief, measured: PoseBelief) -> PoseBelief | None:
        """The Kalman update by a measured pose; None if it is beyond the gate."""
        innovation = measured.pose - belief.pose
        innovation[2] = se2.wrap_angle(innovation[2])
        S = belief.covariance + measured.covariance
        if float(innovation @ np.linalg.solve(S, innovation)) > self._gate:
            return None
        K = np.linalg.solve(S, belief.covariance).T
        pose = belief.pose + K @ innovation
        pose[2] = se2.wrap_angle(pose[2])
        A = np.eye(3) - K
        return PoseBelief(pose, A @ belief.covariance @ A.T + K @ measured.covariance @ K.T)

    def _trim(self, before_ns: int) -> None:
        """Remove states older than the window, which cannot change any more, except for the last of them."""
        if self._states[0].stamp_ns > before_ns:
            return
        stamps = [state.stamp_ns for state in self._states]
        first = max(bisect_right(stamps, before_ns) - 1, 0)
        if first == 0:
            return
        self._is_trimmed = True
        oldest = self._states[first]
        for measured in [m for m in self._measurements if m.stamp_ns <= oldest.stamp_ns]:
            verdict = self._verdicts.pop(measured.number, ("skipped.pose.no_odometry",))
            self._final_counters.update(verdict)
        self._measurements = [m for m in self._measurements if m.stamp_ns > oldest.stamp_ns]
        del self._states[:first]
