"""Extended Kalman filter over (x, y, yaw) that fuses odometry with absolute poses (stereo-bayes, paper section 1)."""

from __future__ import annotations

from bisect import bisect_right, insort
from collections import Counter
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

_BEFORE_ALL_NS = -(2**62)  # earlier than any stamp


@dataclass(frozen=True, slots=True)
class RootMotionNoise:
    """Motion noise whose standard deviations grow with the square root of the motion.

    `translation_m` is that of each coordinate (m) after 1 m of travel. `rotation_rad` is that of the yaw (rad) after 1 rad of
    rotation, `rotation_per_m_rad` after 1 m of travel.
    """

    translation_m: float
    rotation_rad: float
    rotation_per_m_rad: float

    def covariance(self, step: Floats) -> Floats:
        """Covariance `(3, 3)` of a step `(3,)` in the robot's frame."""
        distance, rotation = float(np.hypot(step[0], step[1])), abs(float(step[2]))
        variance_m2 = self.translation_m**2 * distance
        yaw_variance = self.rotation_rad**2 * rotation + self.rotation_per_m_rad**2 * distance
        return np.diag([variance_m2, variance_m2, yaw_variance])


@dataclass(frozen=True, slots=True)
class FilterSettings:
    """Limits for rejecting absolute poses, and for restarting after rejections.

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
    """An absolute pose; `number` counts the absolute poses in order of arrival."""

    stamp_ns: int
    number: int
    pose: tuple[float, float, float]
    covariance: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class _Alternative:
    """A second belief, from the last `count` absolute poses: all were rejected, and they agree with each other."""

    belief: PoseBelief
    count: int


@dataclass(slots=True)
class _OdometryState:
    """T_odom_base `(3,)` at a stamp, with the belief and the alternative from all data up to that stamp."""

    stamp_ns: int
    odometry: Floats
    belief: PoseBelief | None
    alternative: _Alternative | None


class AbsolutePoseFilter:
    """Processes odometry and absolute poses in the order of their stamps.

    A late absolute pose is inserted at its stamp, and all later states are computed again. An absolute pose beyond the gate is
    rejected. Consecutive rejected poses that agree with each other form an alternative belief, which also follows the odometry.
    After `reset_after` of them it replaces the belief of the filter. Outliers that disagree with each other never replace it.

    `start` is T_map_base at the first odometry; with None the filter starts at the first absolute pose. Counters: used.pose,
    pose.resets, skipped.pose.<reason>. Reasons: rejected (beyond the gate), too_late, not_finite (also a covariance that is not
    positive definite), no_odometry (no odometry at or after the stamp yet).
    """

    def __init__(self, noise: RootMotionNoise, settings: FilterSettings, start: PoseBelief | None) -> None:
        self._noise = noise
        self._gate = settings.gate
        self._window_ns = int(settings.window_s * 1e9)
        self._reset_after = settings.reset_after
        self._start = start
        self._states: list[_OdometryState] = []
        self._measurements: list[_Measurement] = []
        # Counters that each measurement in the window increments, by the number of the measurement.
        self._verdicts: dict[int, tuple[str, ...]] = {}
        self._final_counters: Counter[str] = Counter()
        self._arrivals = 0
        self._is_trimmed = False

    @property
    def counters(self) -> Counter[str]:
        """Number of absolute poses used, number skipped for each reason, and number of resets; also skipped odometry."""
        waiting = sum(measured.number not in self._verdicts for measured in self._measurements)
        return (
            self._final_counters
            + Counter(chain.from_iterable(self._verdicts.values()))
            + Counter({"skipped.pose.no_odometry": waiting})
        )

    def set_noise(self, noise: RootMotionNoise) -> None:
        """Replace the motion noise in all later computations."""
        self._noise = noise

    def start_at(self, start: PoseBelief) -> None:
        """Initialise the filter with T_map_base at the first odometry.

        No effect before any odometry, after the filter has started, or when the first odometry has left the window.
        """
        if not self._is_trimmed and self._states and self._states[-1].belief is None:
            self._start = start
            for k in range(len(self._states)):
                self._advance(k)

    @property
    def is_absolute(self) -> bool:
        """Whether an absolute pose has been used; if not, the map drifts with the odometry."""
        return self.counters["used.pose"] > 0

    @property
    def last_stamp_ns(self) -> int | None:
        """Stamp of the latest odometry."""
        return self._states[-1].stamp_ns if self._states else None

    def add_odometry(self, stamp_ns: int, odometry: Floats) -> None:
        """Add T_odom_base `(3,)`. Odometry that is not finite or not newer than the latest is skipped and counted."""
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
        self._arrivals += 1
        x, y, yaw = pose.tolist()
        measured = _Measurement(stamp_ns, self._arrivals, (x, y, yaw), tuple(covariance.ravel().tolist()))
        insort(self._measurements, measured)
        first = bisect_right([state.stamp_ns for state in self._states], stamp_ns - 1)
        for k in range(first, len(self._states)):
            self._advance(k)

    def at(self, stamp_ns: int) -> PoseBelief | None:
        """Belief at a stamp, interpolated between odometry; after the latest odometry, the belief there.

        None before the first odometry in the window, and while no pose is known.
        """
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
        """Compute belief and alternative of state k from state k - 1 and the absolute poses stamped between the two."""
        state = self._states[k]
        if k == 0:
            belief, alternative, since_ns, odometry = self._start, None, _BEFORE_ALL_NS, state.odometry
        else:
            before = self._states[k - 1]
            belief, alternative = before.belief, before.alternative
            since_ns, odometry = before.stamp_ns, before.odometry
        span_ns = state.stamp_ns - since_ns
        low = bisect_right([measured.stamp_ns for measured in self._measurements], since_ns)
        for measured in self._measurements[low:]:
            if measured.stamp_ns > state.stamp_ns:
                break
            interpolated = odometry
            if k:
                fraction = (measured.stamp_ns - since_ns) / span_ns
                interpolated = np.asarray(se2.interpolate(odometry, state.odometry, fraction))
            belief, alternative = self._predict_both(belief, alternative, se2.between(odometry, interpolated))
            odometry = interpolated
            belief, alternative = self._update_both(belief, alternative, measured)
        step = se2.between(odometry, state.odometry)  # the motion after the last absolute pose
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
        return PoseBelief(*se2.compound(belief.pose, belief.covariance, step, self._noise.covariance(step)))

    def _update_both(
        self, belief: PoseBelief | None, alternative: _Alternative | None, measured: _Measurement
    ) -> tuple[PoseBelief, _Alternative | None]:
        """Belief and alternative after an absolute pose.

        A pose within the gate updates the belief and ends the alternative. Any other pose updates the alternative, or starts a
        new one if it disagrees with that too. The alternative becomes the belief after `reset_after` poses.
        """
        measurement = PoseBelief(np.array(measured.pose), np.array(measured.covariance).reshape(3, 3))
        updated = measurement if belief is None else self._update(belief, measurement)
        if updated is not None:
            self._verdicts[measured.number] = ("used.pose",)
            return updated, None
        assert belief is not None
        updated_alternative = None if alternative is None else self._update(alternative.belief, measurement)
        if alternative is None or updated_alternative is None:
            alternative = _Alternative(measurement, 1)
        else:
            alternative = _Alternative(updated_alternative, alternative.count + 1)
        if alternative.count < self._reset_after:
            self._verdicts[measured.number] = ("skipped.pose.rejected",)
            return belief, alternative
        self._verdicts[measured.number] = ("used.pose", "pose.resets")
        return alternative.belief, None

    def _update(self, belief: PoseBelief, measured: PoseBelief) -> PoseBelief | None:
        """Belief after the Kalman update by a measured pose; None if the pose is beyond the gate."""
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
        """Remove all states up to `before_ns` except the latest of them; later absolute poses cannot change them."""
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
