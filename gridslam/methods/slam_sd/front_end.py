"""The front end: every scan is matched against a local map of the last key scans, once for all particles.

Two local maps overlap: the older one is matched against while the younger one fills; then the younger takes over
(Hess et al. 2016 lay out submaps this way). The result is an odometry of the accuracy of the lidar over short ways.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels import surfels
from gridslam.maps.tiled import TileStore
from gridslam.methods.slam_sd.config import FrontEndConfig, OdometryConfig
from gridslam.methods.slam_sd.scans import PreparedScan

Floats = NDArray[np.float64]


def odometry_deviations(step: Floats, config: OdometryConfig) -> Floats:
    """Standard deviations (x, y, yaw) of an odometry step `(3,)`."""
    way, turn = float(np.hypot(step[0], step[1])), abs(float(step[2]))
    translation = (
        config.translation_floor_m + config.translation_per_m * way + config.translation_per_rad_m * turn
    )
    rotation = config.rotation_floor_rad + config.rotation_per_rad * turn + config.rotation_per_m_rad * way
    return np.array([translation, translation, rotation])


@dataclass(frozen=True, slots=True)
class Matched:
    """Pose in the front end's own frame, the information `(3, 3)` of scan and odometry about it, and how it went."""

    pose: Floats
    information: Floats
    is_matched: bool


class FrontEnd:
    """Tracks the robot from scan to scan; its frame drifts against the map's."""

    def __init__(self, config: FrontEndConfig, odometry: OdometryConfig, memory_limit_mb: float) -> None:
        self._config = config
        self._odometry = odometry
        self._store = TileStore(2, surfels.CHANNELS, config.resolution_m, memory_limit_mb)
        self._active = 0
        self._counts = [0, 0]
        self.pose = np.zeros(3)

    def track(self, scan: PreparedScan, odometry_step: Floats, has_jumped: bool = False) -> Matched:
        """The pose after one more odometry step `(3,)`, corrected by the scan.

        `has_jumped`: the odometry lost the motion, and says little about the step.
        """
        config = self._config
        predicted = se2.compose(self.pose, odometry_step)
        deviations = odometry_deviations(odometry_step, self._odometry)
        if has_jumped:
            floor = (
                self._odometry.jump_deviation_m,
                self._odometry.jump_deviation_m,
                self._odometry.jump_deviation_rad,
            )
            deviations = np.maximum(deviations, floor)
        prior = np.diag(1.0 / deviations**2)
        start = self._turned_start(scan, predicted, float(deviations[2]))
        pose, information, used = surfels.register(
            self._store.directory[self._active],
            self._store.pool,
            self._store.origin,
            config.resolution_m,
            scan.points,
            scan.normals,
            start,
            predicted,
            prior,
            config.sigma_m,
            config.reach_m,
            config.final_reach_m,
            config.iterations,
        )
        if used < config.min_points:
            self.pose = predicted
            return Matched(predicted, prior, False)
        pose[2] = float(se2.wrap_angle(pose[2]))
        self.pose = pose
        return Matched(pose, information, True)

    def _turned_start(self, scan: PreparedScan, predicted: Floats, deviation_rad: float) -> Floats:
        """Where the odometry leaves the heading open by more than a matching step, look around for it first."""
        config = self._config
        steps = int(np.ceil(2.0 * deviation_rad / config.yaw_step_rad - 1.0))
        if steps <= 0:
            return predicted
        points, normals = scan.subset(config.yaw_points)
        return np.asarray(
            surfels.search_yaw(
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
