"""The front end: every scan is matched against a local map of the last key scans, once for all particles.

Two local maps overlap: the older one is matched against while the younger one fills; then the younger takes over
(Hess et al. 2016 lay out submaps this way). The result is an odometry of the accuracy of the lidar over short ways.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import surfel_registration, surfels
from gridslam.lidar_slam.config import FrontEndConfig, OdometryConfig
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.tiled import TileStore

Floats = NDArray[np.float64]

MAX_GAP_RATIO = 2.5  # a longer pause than so many scan periods tells nothing of the velocity
RECENT_SCANS = 11  # how far back odometry is looked at when it stutters


def odometry_deviations(step: Floats, steady: Floats, config: OdometryConfig) -> Floats:
    """Standard deviations (x, y, yaw) of an odometry step `(3,)`.

    They grow with the motion, and with the acceleration that the step would mean after a `steady` one `(3,)`.
    """
    way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    translation = (
        config.translation_floor_m + config.translation_per_m * way + config.translation_per_rad_m * turn
    )
    rotation = config.rotation_floor_rad + config.rotation_per_rad * turn + config.rotation_per_m_rad * way
    change = np.abs(step - steady)
    translation += config.surprise_share * float(np.hypot(change[0], change[1]))
    rotation += config.surprise_share * min(float(change[2]), np.pi)
    return np.array([translation, translation, rotation])


@dataclass(frozen=True, slots=True)
class Matched:
    """Pose in the front end's own frame, the share of the scan's points that found a surface, and whether that was enough."""

    pose: Floats
    fit: float
    is_matched: bool


@dataclass(frozen=True, slots=True)
class _Moment:
    """What odometry and matching said at one scan."""

    stamp_ns: int
    odometry: Floats
    pose: Floats


class FrontEnd:
    """Tracks the robot from scan to scan; its frame drifts against the map's."""

    def __init__(self, config: FrontEndConfig, odometry: OdometryConfig, memory_limit_mb: float) -> None:
        self._config = config
        self._odometry = odometry
        self._store = TileStore(2, surfels.CHANNELS, config.resolution_m, memory_limit_mb)
        self._active = 0
        self._counts = [0, 0]
        self._recent: deque[_Moment] = deque(maxlen=RECENT_SCANS)
        self.pose = np.zeros(3)

    def track(self, scan: PreparedScan, odometry: Floats, has_jumped: bool = False) -> Matched:
        """The pose at the scan, given T_odom_base `(3,)` at its stamp; the first scan is at the origin.

        `has_jumped`: the odometry lost the motion since the last scan, and says little about it.
        """
        first = Matched(self.pose, 1.0, True)
        match = self._match(scan, odometry, has_jumped) if self._recent else first
        self.pose = match.pose
        self._recent.append(_Moment(scan.stamp_ns, odometry, match.pose))
        return match

    def _match(self, scan: PreparedScan, odometry: Floats, has_jumped: bool) -> Matched:
        config, noise = self._config, self._odometry
        step = se2.between(self._recent[-1].odometry, odometry)
        steady = self._steady_motion(scan.stamp_ns, step)
        deviations = odometry_deviations(step, steady, noise)
        if has_jumped:
            floor = noise.jump_deviation_m, noise.jump_deviation_m, noise.jump_deviation_rad
            deviations = np.maximum(deviations, floor)
        predicted = se2.compose(self.pose, step)
        start = self._turned(scan, predicted, 2.0 * float(deviations[2]) - config.yaw_step_rad)
        match = self._register(scan, start, predicted, deviations)
        if match.fit < config.least_fit and len(scan.points) >= config.min_points:
            match = self._look_around(scan, self._other_guesses(odometry, predicted, steady), match)
        return match

    def _steady_motion(self, stamp_ns: int, step: Floats) -> Floats:
        """The motion since the last scan if the robot has kept its velocity; `step` itself after a gap in the scans."""
        if len(self._recent) < 2:
            return step
        before, last = self._recent[-2], self._recent[-1]
        elapsed = last.stamp_ns - before.stamp_ns
        ratio = (stamp_ns - last.stamp_ns) / elapsed if elapsed > 0 else np.inf
        if not 0.0 < ratio < MAX_GAP_RATIO:
            return step
        return np.asarray(se2.between(before.pose, last.pose) * ratio)

    def _other_guesses(self, odometry: Floats, predicted: Floats, steady: Floats) -> list[Floats]:
        """Where the robot may be if the odometry has stuttered: it holds still and then catches up, in real logs.

        Predicted by the odometry since several scans ago (right again after it caught up), by the last velocity (right while
        it holds still), and somewhat ahead or behind.
        """
        guesses = [predicted, se2.compose(self.pose, steady)]
        earlier = (self._recent[0], self._recent[len(self._recent) // 2])
        guesses += [se2.compose(then.pose, se2.between(then.odometry, odometry)) for then in earlier]
        reach = self._config.look_around_m
        guesses += [se2.compose(predicted, np.array([ahead, 0.0, 0.0])) for ahead in (-reach, reach)]
        return [np.asarray(guess) for guess in guesses]

    def _register(self, scan: PreparedScan, start: Floats, predicted: Floats, deviations: Floats) -> Matched:
        config = self._config
        pose, used = surfel_registration.register(
            self._store.directory[self._active],
            self._store.pool,
            self._store.origin,
            config.resolution_m,
            scan.points,
            scan.normals,
            start,
            predicted,
            np.diag(1.0 / deviations**2),
            config.sigma_m,
            config.reach_m,
            config.final_reach_m,
            config.iterations,
            0.0,
        )[::2]
        if used < config.min_points:
            return Matched(predicted, 0.0, False)
        pose[2] = float(se2.wrap_angle(pose[2]))
        return Matched(pose, used / len(scan.points), True)

    def _look_around(self, scan: PreparedScan, guesses: Sequence[Floats], poor: Matched) -> Matched:
        """The best fit from all guesses, the heading searched for about each."""
        config = self._config
        best = poor
        deviations = np.array([config.look_around_m, config.look_around_m, config.look_around_rad])
        for guess in guesses:
            start = self._turned(scan, guess, config.look_around_rad)
            match = self._register(scan, start, start, deviations)
            if match.fit > max(best.fit, poor.fit + config.better_fit, config.found_fit):
                best = match
        return best

    def _turned(self, scan: PreparedScan, predicted: Floats, window_rad: float) -> Floats:
        """Where the odometry leaves the heading open by more than a matching step, look around for it first."""
        config = self._config
        steps = int(np.ceil(window_rad / config.yaw_step_rad))
        if steps <= 0:
            return predicted
        points, normals = scan.subset(config.yaw_points)
        return np.asarray(
            surfel_registration.search_yaw(
                self._store.directory[self._active],
                self._store.pool,
                self._store.origin,
                config.resolution_m,
                points,
                normals,
                predicted,
                config.yaw_step_rad,
                steps,
                2.0 * config.sigma_m,
                0.75 * config.reach_m,
            )
        )

    def add_key_scan(self, scan: PreparedScan) -> None:
        """Take the scan at the present pose into the local maps."""
        active, other = self._active, 1 - self._active
        self._insert(active, scan)
        if self._counts[active] >= self._config.key_scans:
            self._insert(other, scan)
        if self._counts[other] >= self._config.key_scans:
            self._store.clear(active)
            self._counts[active] = 0
            self._active = other

    def _insert(self, index: int, scan: PreparedScan) -> None:
        self._store.own_end_points(np.array([index]), self.pose[None], scan.surface)
        surfels.insert_surfels(
            self._store.directory[index],
            self._store.pool,
            self._store.origin,
            self._config.resolution_m,
            self.pose,
            scan.surface,
            scan.surface_normals,
        )
        self._counts[index] += 1
