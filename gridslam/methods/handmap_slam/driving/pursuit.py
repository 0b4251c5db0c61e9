"""Path following with the Dynamic Window Approach, and recovery when the robot is stuck (paper section 5)."""

from __future__ import annotations

from collections import deque
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import cumulative_distance
from gridslam.kernels.planning.wheel_window import free_distances
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.scan_memory import BeamEndpoints
from gridslam.planning.dwa import DifferentialDrive, DwaSettings, WheelSpeeds, choose_speeds

Floats = NDArray[np.float64]

MAX_YAW_RATE_RADPS = 1.2
MAX_ACCELERATION_MPS2 = 0.6  # largest acceleration of a wheel
LOOK_AHEAD_M = 0.8  # distance along the path to the point that the robot heads for
RECENT_SCANS = 3  # whose points are obstacles
OBSTACLE_RANGE_M = 3.0
STUCK_S = 3.0  # standing for this long starts a recovery
STUCK_M, STUCK_RAD = 0.08, 0.3  # less motion within STUCK_S is standing
FREED_M = 3.0 * STUCK_M  # motion after which the next recovery starts with a turn again
RECOVERY_S = 2.5  # duration of a recovery
BACK_OFF_M = 0.3
RECOVERY_SPEED = 0.5  # speed of a recovery's rotation, as a fraction of the highest yaw rate
MIN_BACK_OFF_M = 0.1  # free space behind the robot
ALIGNED_RAD = 0.1  # no turn is needed below this bearing
MAX_BEARING_RAD = 1.0  # largest bearing of the path: beyond it the robot turns before it drives
SLOW_DOWN_M = 0.8  # distance to the end of the path below which the robot slows down
MIN_REMAINING_M = 0.2  # the speed near the end is that of this distance
TURNING_SPEED_WEIGHT = -2.0  # factor on the speed's weight while the robot turns: forward motion is penalised

SETTINGS = DwaSettings(
    period_s=0.1,
    delay_s=0.15,
    samples=11,
    prediction_s=0.7,
    margin_m=0.04,
    max_clearance_m=1.5,
    heading_weight=1.0,
    clearance_weight=0.25,
    speed_weight=0.35,
)


class Pursuit:
    """Follows the last path, kept in the odometry's frame between plans: a jump of the drawing pose does not deform it."""

    def __init__(self, config: ExplorationConfig, drive: DifferentialDrive) -> None:
        self._drive = replace(
            drive,
            max_speed_mps=min(config.max_speed_mps, drive.max_speed_mps),
            acceleration_mps2=min(MAX_ACCELERATION_MPS2, drive.acceleration_mps2),
            max_yaw_rate_radps=min(MAX_YAW_RATE_RADPS, drive.max_yaw_rate_radps),
        )
        self._path = np.zeros((0, 2))  # in the odometry's frame
        self._scans: deque[tuple[Floats, Floats]] = deque(maxlen=RECENT_SCANS)
        self._recent_poses: deque[tuple[int, Floats]] = deque()
        self._recovering_until_ns = 0
        self._attempts = 0
        self.recoveries = 0

    def add_scan(self, T_odom_base: Floats, scan: BeamEndpoints) -> None:
        """Use the points of a scan, taken at T_odom_base `(3,)`, as obstacles until `RECENT_SCANS` later ones have come."""
        near = scan.points[np.abs(scan.points).max(axis=1) < OBSTACLE_RANGE_M + 1.0]
        self._scans.append((T_odom_base.copy(), near))

    def follow(self, path: Floats, T_odom_base: Floats) -> None:
        """Follow a path `(n, 2)` in the robot's current frame (m); an empty path stops the robot."""
        self._path = se2.transform_points(T_odom_base, path) if len(path) else np.zeros((0, 2))

    def command(self, stamp_ns: int, T_odom_base: Floats, current: WheelSpeeds) -> WheelSpeeds:
        """Wheel speeds for the next period, given T_odom_base `(3,)` at a stamp and the current speeds."""
        obstacles = self.obstacles(T_odom_base)
        if not len(self._path):
            self._recent_poses.clear()
            return WheelSpeeds.standing()
        path = se2.transform_points(se2.inverse(T_odom_base), self._path)
        target = look_ahead(path, LOOK_AHEAD_M)
        if stamp_ns < self._recovering_until_ns:
            return self._recover(target, obstacles)
        if self._is_stuck(stamp_ns, T_odom_base):
            self.recoveries += 1
            self._attempts += 1
            self._recovering_until_ns = stamp_ns + int(RECOVERY_S * 1e9)
            self._recent_poses.clear()
            return self._recover(target, obstacles)
        return self._drive_to(target, float(np.hypot(*path[-1])), obstacles, current)

    def obstacles(self, T_odom_base: Floats) -> Floats:
        """Points `(m, 2)` (m, robot's current frame) that the last scans hit nearby."""
        pieces = [
            se2.transform_points(se2.between(T_odom_base, then), points) for then, points in self._scans
        ]
        if not pieces:
            return np.zeros((0, 2))
        points = np.concatenate(pieces)
        return np.ascontiguousarray(points[np.hypot(points[:, 0], points[:, 1]) < OBSTACLE_RANGE_M])

    def _drive_to(
        self, target: Floats, remaining_m: float, obstacles: Floats, current: WheelSpeeds
    ) -> WheelSpeeds:
        """The best speeds of the dynamic window; lower where the path turns away and before its end."""
        bearing = abs(float(np.arctan2(target[1], target[0])))
        ending = min(1.0, max(remaining_m, MIN_REMAINING_M) / SLOW_DOWN_M)
        factor = max(np.cos(bearing), 0.0) * ending
        settings = replace(SETTINGS, speed_weight=SETTINGS.speed_weight * factor)
        if bearing > MAX_BEARING_RAD:
            weight = TURNING_SPEED_WEIGHT * SETTINGS.speed_weight
            settings = replace(settings, clearance_weight=0.0, speed_weight=weight)
        return choose_speeds(current, target, obstacles, self._drive, settings)

    def _is_stuck(self, stamp_ns: int, T_odom_base: Floats) -> bool:
        """Whether the robot has hardly moved for STUCK_S."""
        self._recent_poses.append((stamp_ns, T_odom_base.copy()))
        limit_ns = int(STUCK_S * 1e9)
        if stamp_ns - self._recent_poses[0][0] < limit_ns:
            return False
        while len(self._recent_poses) > 1 and stamp_ns - self._recent_poses[1][0] >= limit_ns:
            self._recent_poses.popleft()
        motion = se2.between(self._recent_poses[0][1], T_odom_base)
        distance_m = float(np.hypot(motion[0], motion[1]))
        if distance_m > STUCK_M or abs(float(motion[2])) > STUCK_RAD:
            if distance_m > FREED_M:
                self._attempts = 0
            return False
        return True

    def _recover(self, target: Floats, obstacles: Floats) -> WheelSpeeds:
        """Turn towards the path; in every second attempt back off, if there is room behind."""
        wheel_mps = RECOVERY_SPEED * self._drive.max_yaw_rate_radps * self._drive.base_m
        if self._attempts % 2:
            bearing = float(np.arctan2(target[1], target[0]))
            if abs(bearing) < ALIGNED_RAD:
                return WheelSpeeds.standing()
            side = 0.5 * float(np.copysign(min(1.0, abs(bearing)), bearing))
            return WheelSpeeds(-side * wheel_mps, side * wheel_mps)
        speed = BACK_OFF_M / RECOVERY_S
        back = np.array([[-speed, -speed]])
        radius = self._drive.radius_m + SETTINGS.margin_m
        free_m = float(free_distances(back, obstacles, self._drive.base_m, radius, 1.0)[0])
        if free_m > MIN_BACK_OFF_M:
            return WheelSpeeds(-speed, -speed)
        return WheelSpeeds(-0.5 * wheel_mps, 0.5 * wheel_mps)


def look_ahead(path: Floats, distance_m: float) -> Floats:
    """The point `(2,)` of a path `(n, 2)` (robot's frame) that lies `distance_m` beyond the one nearest to the robot."""
    nearest = int(np.hypot(path[:, 0], path[:, 1]).argmin())
    rest = path[nearest:]
    along = cumulative_distance(rest)
    return np.asarray(rest[min(int(np.searchsorted(along, distance_m)), len(rest) - 1)])
