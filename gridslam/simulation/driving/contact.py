"""Collision check for driven simulations: the simulator itself moves the robot through walls."""

from __future__ import annotations

import numpy as np

from gridslam.simulation.geometry import Array
from gridslam.simulation.simulator import Simulator

MIN_STEP_M = 0.005  # a robot next to a surface is checked again after this distance


class ContactWatch:
    """Reports when the robot's disc touches a surface.

    `clearance_m` is the smallest distance so far between the disc and any surface. A new check is made only after the robot
    has driven far enough to change it.
    """

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._next_check_m = 0.0
        self._has_people = bool(simulator.world.people)
        self.clearance_m = np.inf

    @property
    def is_touching(self) -> bool:
        """Whether the disc touches a surface now."""
        robot = self._simulator.robot
        if not self._has_people and robot.distance_m < self._next_check_m:
            return False
        free = surface_distance(self._simulator, robot.x, robot.y) - self._simulator.world.robot.radius_m
        self.clearance_m = min(self.clearance_m, free)
        self._next_check_m = robot.distance_m + max(free - self.clearance_m, MIN_STEP_M)
        return free <= 0.0


def surface_distance(simulator: Simulator, x: float, y: float) -> float:
    """Distance (m) from a point to the nearest surface of the world at the present time; 0 inside a cylinder."""
    scene = simulator.scene
    nearest = np.inf
    for segments in (scene.static_segments, scene.moving_segments):
        if len(segments):
            nearest = min(nearest, float(_to_segments(segments, x, y).min()))
    circles = scene.circles(simulator.time_s)
    if len(circles):
        distances = np.hypot(circles[:, 0] - x, circles[:, 1] - y) - circles[:, 2]
        nearest = min(nearest, max(float(distances.min()), 0.0))
    return nearest


def _to_segments(segments: Array, x: float, y: float) -> Array:
    """Distances `(n,)` of a point to segments `(n, 4)`."""
    start, direction = segments[:, :2], segments[:, 2:] - segments[:, :2]
    to_point = np.array([x, y]) - start
    length2 = np.maximum((direction**2).sum(axis=1), 1e-18)
    fraction = np.clip((to_point * direction).sum(axis=1) / length2, 0.0, 1.0)
    offset = to_point - fraction[:, None] * direction
    return np.asarray(np.hypot(offset[:, 0], offset[:, 1]))
