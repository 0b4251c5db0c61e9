"""Motions of the odometry and of scan matching over the same windows of time, and what they say about lag, sign and scale."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.trajectory import Trajectory, time_windows
from gridslam.lidar_slam.sensor_checks.heading_errors import NO_ERRORS, HeadingErrors, find_heading_errors
from gridslam.lidar_slam.sensor_checks.odometry_correction import OdometryCorrection

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NO_STRETCHES: Ints = np.zeros((0, 2), np.int64)
WINDOW_S = 1.0  # motions are compared over this long: matching is then more exact than any odometry
# Tried if no lag of `LAGS_S` explains the rotations
FAR_LAGS_S: Floats = np.concatenate([np.arange(-600, -150, 5), np.arange(155, 605, 5)]) * 0.01
LAGS_S: Floats = np.arange(-150, 151, dtype=np.float64) * 0.01
# Smallest lag that is a fault, beside the odometry's period: between its poses motion is not known
MIN_LAG_S = 0.05
YAW_NOISE_RAD = 0.01  # noise of the rotation in a window: smaller differences are not evidence
# Largest ratio of the costs with and without a correction: above it the difference may be chance ...
MAX_COST_RATIO = 0.6
MIN_Z_SCORE = 3.0  # ... unless it is as large as this, in standard deviations of its mean
UNDECIDED_Z_SCORE = 1.5  # from this z score on more motion may decide
POSSIBLE_Z_SCORE = 2.0  # lags whose differences are larger by less than this may be the true one
MIN_ROTATION_RAD = 2.0  # smallest rotation of all windows together, by matching
MIN_WINDOW_M = 0.2  # smallest motion in a window that shows the scale


def windows_of(track: Trajectory, odometry: Trajectory, open_ns: Ints = NO_STRETCHES) -> MotionWindows | None:
    """Motions of a track by scan matching and of the odometry over windows of about `WINDOW_S`; None if none fits.

    Left out are windows that touch a stretch of `open_ns`, first and last stamps `(k, 2)` between which the scans do not show
    how far the robot moved.
    """
    starts, ends = time_windows(track.stamps_ns, WINDOW_S)
    began = np.searchsorted(np.sort(open_ns[:, 0]), track.stamps_ns[ends], side="right")
    ended = np.searchsorted(np.sort(open_ns[:, 1]), track.stamps_ns[starts], side="left")
    is_used = began == ended
    if not is_used.any() or len(odometry) < 2:
        return None
    return MotionWindows(track, odometry, starts[is_used], ends[is_used], used_ratio=float(is_used.mean()))


class MotionWindows:
    """Motions of the track and of the odometry over the same windows, the fraction `used_ratio` of all."""

    def __init__(
        self, track: Trajectory, odometry: Trajectory, starts: Ints, ends: Ints, used_ratio: float
    ) -> None:
        self._used_ratio = used_ratio
        self._origin_ns = int(track.stamps_ns[0])
        times = self._seconds(track.stamps_ns)
        self._start_s, self._end_s = times[starts], times[ends]
        self._matched = se2.between(track.poses[starts], track.poses[ends])
        yaw = np.unwrap(track.poses[:, 2])
        self._matched[:, 2] = yaw[ends] - yaw[starts]
        order = np.argsort(odometry.stamps_ns, kind="stable")
        self._odometry_s = self._seconds(odometry.stamps_ns[order])
        self._period_s = float(np.median(np.diff(self._odometry_s)))
        self._odometry = odometry.poses[order].copy()
        self._odometry[:, 2] = np.unwrap(self._odometry[:, 2])

    def motions(self, correction: OdometryCorrection) -> tuple[Floats, Floats]:
        """Motions `(n, 3)` of the windows by corrected odometry and by matching."""
        path = correction.heading.removed_from(self._odometry_s, correction.poses(self._odometry))
        start, end = (self._at(t, correction.lag_s, path) for t in (self._start_s, self._end_s))
        return se2.between(start, end), self._matched

    def heading_errors(self, correction: OdometryCorrection) -> HeadingErrors:
        """Errors of the odometry's rotations after the correction; none without evidence."""
        if np.abs(self._matched[:, 2]).sum() < MIN_ROTATION_RAD:
            return NO_ERRORS
        path = correction.poses(self._odometry)
        forward = np.concatenate([[0.0], np.cumsum(se2.between(path[:-1], path[1:])[:, 0])])
        progress = np.column_stack([path[:, 2], forward, self._odometry_s])
        start, end = (self._at(t, correction.lag_s, progress) for t in (self._start_s, self._end_s))
        return find_heading_errors(end - start, self._matched[:, 2], self._independent)

    def lag_and_sign(self) -> OdometryCorrection:
        """Lag of the odometry and whether its yaw is mirrored; none and not mirrored without evidence."""
        matched_rad = float(np.abs(self._matched[:, 2]).sum())
        if matched_rad < MIN_ROTATION_RAD:
            start, end = (self._at(t, 0.0)[:, 2] for t in (self._start_s, self._end_s))
            return OdometryCorrection(is_undecided=float(np.abs(end - start).sum()) > 2.0 * MIN_ROTATION_RAD)
        errors = {sign: np.array([self._yaw_errors(float(lag), sign) for lag in LAGS_S]) for sign in (1, -1)}
        smallest = {sign: float(error.mean(axis=1).min()) for sign, error in errors.items()}
        is_mirrored = smallest[-1] < MAX_COST_RATIO * smallest[1]
        found = errors[-1 if is_mirrored else 1]
        costs, at_zero = found.mean(axis=1), len(LAGS_S) // 2
        best = int(costs.argmin())
        lag_s = float(LAGS_S[best])
        possible = LAGS_S[[self._z_score(error - found[best]) < POSSIBLE_Z_SCORE for error in found]]
        result = OdometryCorrection(
            mirrors_yaw=is_mirrored, possible_lags_s=(float(possible[0]), float(possible[-1]))
        )
        if (far := self._far_lag(float(costs[best]))) is not None:
            return far
        if abs(lag_s) < MIN_LAG_S:
            return result
        z_score = self._z_score(found[at_zero] - found[best])
        if costs[best] < MAX_COST_RATIO * costs[at_zero] or z_score > MIN_Z_SCORE:
            return replace(result, lag_s=lag_s if abs(lag_s) >= self._period_s else 0.0)
        return replace(result, is_undecided=z_score > UNDECIDED_Z_SCORE)

    def _far_lag(self, near_cost: float) -> OdometryCorrection | None:
        """A lag of seconds with which the rotations agree far better than with any near one; None: there is none."""
        found = []
        for sign in (1.0, -1.0):
            coarse = [float(self._yaw_errors(float(lag), sign).mean()) for lag in FAR_LAGS_S]
            fine_s = FAR_LAGS_S[int(np.argmin(coarse))] + np.arange(-5, 6) * 0.01
            fine = [float(self._yaw_errors(float(lag), sign).mean()) for lag in fine_s]
            found.append((min(fine), float(fine_s[int(np.argmin(fine))]), sign))
        cost, lag_s, sign = min(found)
        if cost >= MAX_COST_RATIO * near_cost:
            return None
        return OdometryCorrection(lag_s=lag_s, mirrors_yaw=sign < 0.0, possible_lags_s=(lag_s, lag_s))

    def translation_cost(self, correction: OdometryCorrection) -> float:
        """Mean difference (m) of the windows' translations."""
        moved, matched = self.motions(correction)
        return float(np.hypot(*(moved - matched)[:, :2].T).mean())

    def distance_ratios(self, lag_s: float, max_rotation_rad: float = np.inf) -> tuple[Floats, Floats]:
        """Ratios `(k,)` of the distances by matching to those by odometry in windows that show them, and their weights."""
        start, end = self._at(self._start_s, lag_s), self._at(self._end_s, lag_s)
        by_odometry = np.hypot(*(end - start)[:, :2].T)
        matched = np.hypot(*self._matched[:, :2].T)
        shown = (by_odometry > MIN_WINDOW_M) & (matched > MIN_WINDOW_M)
        shown &= np.abs(self._matched[:, 2]) < max_rotation_rad
        return matched[shown] / by_odometry[shown], matched[shown]

    def _yaw_errors(self, lag_s: float, sign: float) -> Floats:
        """Absolute differences `(n,)` (rad) of the windows' rotations, and the noise."""
        rotation = sign * (self._at(self._end_s, lag_s)[:, 2] - self._at(self._start_s, lag_s)[:, 2])
        return np.asarray(np.abs(rotation - self._matched[:, 2]) + YAW_NOISE_RAD)

    def _z_score(self, differences: Floats) -> float:
        """Mean of differences `(n,)` of the windows in its standard deviations; windows that overlap are not independent."""
        return float(differences.mean() * np.sqrt(self._independent) / max(float(differences.std()), 1e-9))

    @property
    def _independent(self) -> float:
        """The number of windows that do not overlap."""
        return max(self._used_ratio * float(self._end_s[-1] - self._start_s[0]) / WINDOW_S, 1.0)

    def _at(self, times_s: Floats, lag_s: float, path: Floats | None = None) -> Floats:
        """Poses `(n, 3)` at `times_s + lag_s`, interpolated linearly in the odometry or in `path`, which has the same stamps."""
        at = times_s + lag_s
        columns = (self._odometry if path is None else path).T
        return np.column_stack([np.interp(at, self._odometry_s, column) for column in columns])

    def _seconds(self, stamps_ns: Ints) -> Floats:
        return np.asarray((stamps_ns - self._origin_ns) * 1e-9)
