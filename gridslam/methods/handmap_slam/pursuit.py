"""Following a path with the Dynamic Window Approach, and getting free when it does not go on (paper section 5)."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.wheel_window import free_distances
from gridslam.methods.handmap_slam.planning_config import ExplorationConfig
from gridslam.methods.handmap_slam.seen_scans import SeenScan
from gridslam.planning.dwa import Drive, Window, choose_speeds

Floats = NDArray[np.float64]

PERIOD_S = 0.1  # between commands
SCANS_KEPT = 3  # whose points are obstacles
OBSTACLES_WITHIN_M = 3.0
MOVED_M, MOVED_RAD = 0.08, 0.3  # less than this while `stuck_s` passes is standing
TURN_S, BACK_S = 2.5, 2.5  # of one attempt to get free
ASIDE_RAD = 1.0  # with the path so far aside the robot turns before it drives
SLOW_WITHIN_M = 0.8


@dataclass(frozen=True, slots=True)
class Command:
    """Speeds of the left and right wheel (m/s along the ground)."""

    left_mps: float
    right_mps: float

    @staticmethod
    def stand() -> Command:
        """Stop."""
        return Command(0.0, 0.0)


class Pursuit:
    """Follows the path given last, kept in the odometry's frame between plans: a leap of the drawing pose does not bend it."""

    def __init__(self, config: ExplorationConfig, drive: Drive) -> None:
        motion = config.motion
        self._config = config
        self._drive = replace(
            drive,
            max_speed_mps=min(motion.speed_mps, drive.max_speed_mps),
            acceleration_mps2=min(motion.acceleration_mps2, drive.acceleration_mps2),
            max_turn_radps=min(motion.turn_radps, drive.max_turn_radps),
        )
        self._window = Window(
            PERIOD_S,
            motion.delay_s,
            motion.samples,
            motion.look_s,
            motion.margin_m,
            motion.far_m,
            motion.heading,
            motion.clearance,
            motion.speed,
        )
        self._way = np.zeros((0, 2))  # in the odometry's frame
        self._scans: deque[tuple[Floats, Floats]] = deque(maxlen=SCANS_KEPT)
        self._been: deque[tuple[int, Floats]] = deque()
        self._free_until_ns = 0
        self._attempts = 0
        self.recoveries = 0

    def see(self, T_odom_base: Floats, scan: SeenScan) -> None:
        """Take in a scan: its points are obstacles for a short while."""
        near = scan.points[np.abs(scan.points).max(axis=1) < OBSTACLES_WITHIN_M + 1.0]
        self._scans.append((T_odom_base.copy(), near))

    def follow(self, way: Floats, T_odom_base: Floats) -> None:
        """Go along a way `(n, 2)` given in the robot's present frame; an empty one: wait."""
        self._way = se2.transform_points(T_odom_base, way) if len(way) else np.zeros((0, 2))

    def command(self, stamp_ns: int, T_odom_base: Floats, speeds: tuple[float, float]) -> Command:
        """Wheel speeds for the next moment from the present ones."""
        obstacles = self.obstacles(T_odom_base)
        if not len(self._way):
            self._been.clear()
            return Command.stand()
        way = se2.transform_points(se2.inverse(T_odom_base), self._way)
        target = look_ahead(way, self._config.path.look_ahead_m)
        if stamp_ns < self._free_until_ns:
            return self._get_free(target, obstacles)
        if self._is_stuck(stamp_ns, T_odom_base):
            self.recoveries += 1
            self._attempts += 1
            self._free_until_ns = stamp_ns + int((TURN_S if self._attempts % 2 else BACK_S) * 1e9)
            self._been.clear()
            return self._get_free(target, obstacles)
        return self._drive_to(target, float(np.hypot(*way[-1])), obstacles, speeds)

    def obstacles(self, T_odom_base: Floats) -> Floats:
        """Points `(m, 2)` in the robot's present frame that the last scans have hit nearby."""
        pieces = [
            se2.transform_points(se2.between(T_odom_base, then), points) for then, points in self._scans
        ]
        if not pieces:
            return np.zeros((0, 2))
        points = np.concatenate(pieces)
        return np.ascontiguousarray(points[np.hypot(points[:, 0], points[:, 1]) < OBSTACLES_WITHIN_M])

    def _drive_to(
        self, target: Floats, left_m: float, obstacles: Floats, speeds: tuple[float, float]
    ) -> Command:
        """The best of the window; slower where the path turns away and before its end."""
        aside = abs(float(np.arctan2(target[1], target[0])))
        share = max(np.cos(aside), 0.0) * min(1.0, max(left_m, 0.2) / SLOW_WITHIN_M)
        window = replace(self._window, speed=self._window.speed * share)
        if aside > ASIDE_RAD:
            window = replace(window, clearance=0.0, speed=-2.0 * self._window.speed)
        choice = choose_speeds(speeds, target, obstacles, self._drive, window)
        return Command(choice.left_mps, choice.right_mps)

    def _is_stuck(self, stamp_ns: int, T_odom_base: Floats) -> bool:
        """Whether the robot has hardly moved for long."""
        self._been.append((stamp_ns, T_odom_base.copy()))
        limit_ns = int(self._config.patience.stuck_s * 1e9)
        if stamp_ns - self._been[0][0] < limit_ns:
            return False
        while len(self._been) > 1 and stamp_ns - self._been[1][0] >= limit_ns:
            self._been.popleft()
        moved = se2.between(self._been[0][1], T_odom_base)
        if float(np.hypot(moved[0], moved[1])) > MOVED_M or abs(float(moved[2])) > MOVED_RAD:
            if float(np.hypot(moved[0], moved[1])) > 3.0 * MOVED_M:
                self._attempts = 0
            return False
        return True

    def _get_free(self, target: Floats, obstacles: Floats) -> Command:
        """Turn towards the path; every second time back off, as far as nothing is behind."""
        turn = 0.5 * self._drive.max_turn_radps * self._drive.base_m
        if self._attempts % 2:
            bearing = float(np.arctan2(target[1], target[0]))
            if abs(bearing) < 0.1:
                return Command.stand()
            side = 0.5 * float(np.copysign(min(1.0, abs(bearing)), bearing))
            return Command(-side * turn, side * turn)
        speed = self._config.patience.back_off_m / BACK_S
        back = np.array([[-speed, -speed]])
        radius = self._drive.radius_m + self._window.margin_m
        free = float(free_distances(back, obstacles, self._drive.base_m, radius, 1.0)[0])
        return Command(-speed, -speed) if free > 0.1 else Command(-0.5 * turn, 0.5 * turn)


def look_ahead(way: Floats, distance_m: float) -> Floats:
    """The point `(2,)` of a way `(n, 2)` (robot's frame) that lies so far on from the one nearest to the robot."""
    nearest = int(np.hypot(way[:, 0], way[:, 1]).argmin())
    rest = way[nearest:]
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rest, axis=0).T))])
    return np.asarray(rest[min(int(np.searchsorted(along, distance_m)), len(rest) - 1)])
