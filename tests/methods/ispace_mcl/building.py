"""A small building without alike places, and the log of a robot in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, Odometry, Transform, readonly
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from tests.reference.ray_traversal import cast_cell_by_cell

STEP_M = 0.1
LIDAR = np.array([0.2, 0.0, 0.0])
BEAMS = 60


def building() -> OccupancyGrid:
    """Two rooms and a corridor, 12 m x 8 m, with a few cupboards."""
    occupied = np.zeros((80, 120), bool)
    occupied[[0, 1, -2, -1]] = occupied[:, [0, 1, -2, -1]] = True
    occupied[30:32, :] = True  # the corridor's upper wall
    occupied[30:32, 20:29] = occupied[30:32, 84:93] = False  # doors
    occupied[30:, 55:57] = True  # between the rooms
    occupied[60:70, 2:14] = occupied[40:50, 48:55] = True
    occupied[66:78, 80:86] = occupied[36:41, 105:118] = occupied[45:50, 66:71] = True
    occupied[2:8, 50:60] = occupied[22:30, 100:104] = True
    return OccupancyGrid(np.where(occupied, 0.95, 0.05).astype(np.float32), GridGeometry(STEP_M, (-3.0, 2.0)))


def drive(waypoints: Sequence[tuple[float, float]], step_m: float = 0.1) -> np.ndarray:
    """Poses `(n, 3)` along straight lines through the waypoints, with rotations on the spot in steps of 0.15 rad."""
    poses: list[np.ndarray] = []
    heading = None
    for start, goal in pairwise(waypoints):
        off = np.subtract(goal, start)
        towards = math.atan2(off[1], off[0])
        if heading is not None:
            rotation = float(se2.wrap_angle(towards - heading))
            steps = max(int(abs(rotation) / 0.15), 1)
            poses += [np.array([*start, heading + rotation * k / steps]) for k in range(1, steps)]
        length = float(np.hypot(*off))
        steps = int(length / step_m)
        poses += [np.array([*(np.asarray(start) + off * k / steps), towards]) for k in range(steps)]
        heading = towards
    return np.array(poses)


def record(grid: OccupancyGrid, path: np.ndarray, seed: int, drift: float = 0.02) -> list[Event]:
    """The log of a drive: odometry that drifts, and scans with 2 cm of noise, some beams without return, 10 a second."""
    rng = np.random.default_rng(seed)
    occupied = grid.probability > 0.5
    events: list[Event] = [
        Transform(0, "base_link", "laser", (LIDAR[0], LIDAR[1], 0.3), (1.0, 0.0, 0.0, 0.0), True)
    ]
    odometry = np.array([4.0, -2.0, 1.0])  # its frame is independent of the map's
    for k, pose in enumerate(path):
        if k:
            step = se2.between(path[k - 1], pose)
            noise = (
                rng.standard_normal(3)
                * drift
                * np.array([np.hypot(*step[:2]), 0.2 * np.hypot(*step[:2]), abs(step[2]) + 0.02])
            )
            odometry = se2.compose(odometry, step + noise)
        stamp = 10**18 + k * 10**8
        events.append(Odometry(stamp, "odom", *map(float, odometry)))
        ranges = scan_at(grid, occupied, pose) + 0.02 * rng.standard_normal(BEAMS)
        ranges[rng.random(BEAMS) < 0.03] = np.inf
        events.append(
            LaserScan(stamp, "laser", readonly(ranges, np.float32), -math.pi, 2 * math.pi / BEAMS, 0.05, 9.0)
        )
    return events


def scan_at(grid: OccupancyGrid, occupied: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Ranges (m) of the lidar all around from a pose of the robot."""
    x, y, yaw = se2.compose(pose, LIDAR)
    origin = grid.geometry.origin_xy_m
    cells = ((x - origin[0]) / STEP_M, (y - origin[1]) / STEP_M)
    angles = yaw - math.pi + 2 * math.pi / BEAMS * np.arange(BEAMS)
    return np.array([STEP_M * cast_cell_by_cell(occupied, *cells, a, 120.0)[0] for a in angles])


WAYPOINTS = [
    (-2.0, 3.8),
    (-0.5, 3.8),
    (-0.5, 6.5),
    (1.2, 7.4),
    (-0.5, 6.5),
    (-0.5, 3.6),
    (5.8, 3.6),
    (5.8, 6.4),
    (4.5, 8.0),
]
ROUND_TRIP = drive(WAYPOINTS)
