"""How near the robot is to what stands about: the simulator moves it whatever it meets, so somebody has to look."""

from __future__ import annotations

import numpy as np

from gridslam.simulation.outlines import Array
from gridslam.simulation.simulator import Simulator

STILL_M = 0.005  # way after which a robot beside a surface is looked at again


class ContactWatch:
    """Tells when the robot's disc touches a surface.

    `clearance_m` is the least distance so far between the disc and any surface; it is looked at no more often than the way
    driven can have changed it by.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._next_way_m = 0.0
        self._moves = bool(simulator.world.people)
        self.clearance_m = np.inf

    @property
    def is_touching(self) -> bool:
        """Whether the disc touches anything now."""
        robot = self._simulator.robot
        if not self._moves and robot.way_m < self._next_way_m:
            return False
        free = surface_distance(self._simulator, robot.x, robot.y) - self._simulator.world.robot.radius_m
        self.clearance_m = min(self.clearance_m, free)
        self._next_way_m = robot.way_m + max(free - self.clearance_m, STILL_M)
        return free <= 0.0


def surface_distance(simulator: Simulator, x: float, y: float) -> float:
    """Distance (m) from a point to the nearest surface of the world as it is now; 0 inside a pillar."""
    scene = simulator.scene
    nearest = np.inf
    for segments in (scene.standing, scene.moving):
        if len(segments):
            nearest = min(nearest, float(_to_segments(segments, x, y).min()))
    circles = scene.circles(simulator.time_s)
    if len(circles):
        away = np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]
        nearest = min(nearest, max(float(away.min()), 0.0))
    return nearest


def _to_segments(segments: Array, x: float, y: float) -> Array:
    """Distances `(n,)` of a point to segments `(n, 4)`."""
    start, way = segments[:, :2], segments[:, 2:] - segments[:, :2]
    to_point = np.array([x, y]) - start
    length2 = np.maximum((way**2).sum(axis=1), 1e-18)
    share = np.clip((to_point * way).sum(axis=1) / length2, 0.0, 1.0)
    off = to_point - share[:, None] * way
    return np.asarray(np.hypot(off[:, 0], off[:, 1]))
