"""Absolute poses from an external source: they arrive late, and some are outliers."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from gridslam.core import poses as se2
from gridslam.core.messages import AbsolutePose, Event, readonly
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.sensor_config import AbsolutePoses
from gridslam.simulation.sensors.timing import Schedule


class AbsolutePoseSource:
    """Absolute poses stamped when they were measured and returned after the delay."""

    def __init__(self, config: AbsolutePoses, start_ns: int, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._schedule = Schedule(config, start_ns, rng, phase=0.7)
        self._waiting: deque[tuple[int, AbsolutePose]] = deque()

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The absolute poses that arrive at this step."""
        if self._schedule.is_due(now_ns):
            self._schedule.advance()
            self._measure(now_ns, robot)
        arrived: list[Event] = []
        while self._waiting and self._waiting[0][0] <= now_ns:
            arrived.append(self._waiting.popleft()[1])
        return arrived

    def _measure(self, now_ns: int, robot: DrivenRobot) -> None:
        config = self._config
        sigma = np.array([config.noise_m, config.noise_m, math.radians(config.noise_deg)])
        error = sigma * self._rng.standard_normal(3)
        draw, direction, length = self._rng.random(3).tolist()
        if draw < config.outliers:
            offset = config.outlier_m * (0.5 + length)
            error[:2] += offset * math.cos(math.tau * direction), offset * math.sin(math.tau * direction)
        pose = robot.pose + error
        pose[2] = float(se2.wrap_angle(pose[2]))
        stamp = self._schedule.stamp_ns(now_ns)
        if stamp is not None:
            measured = AbsolutePose(
                stamp, config.frame, readonly(pose, np.float64), readonly(np.diag(sigma**2), np.float64)
            )
            self._waiting.append((now_ns + round(1e9 * config.delay_s), measured))
