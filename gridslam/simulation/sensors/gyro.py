"""A yaw gyro whose bias is a random walk."""

from __future__ import annotations

import math

import numpy as np

from gridslam.core.messages import Event, Imu
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.sensor_config import Gyro
from gridslam.simulation.sensors.timing import Schedule


class GyroSensor:
    """Reports the mean yaw rate since the previous message."""

    def __init__(self, config: Gyro, start_ns: int, rng: np.random.Generator) -> None:
        self._config = config
        self._rng = rng
        self._schedule = Schedule(config, start_ns, rng, phase=0.5)
        self.bias_radps = config.bias_deviation_radps * float(rng.standard_normal())
        self._last_s, self._last_yaw = 0.0, math.nan

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The messages of this step."""
        if not self._schedule.is_due(now_ns):
            return []
        self._schedule.advance()
        span_s = robot.time_s - self._last_s
        rotation = robot.yaw - self._last_yaw if math.isfinite(self._last_yaw) else 0.0
        self._last_s, self._last_yaw = robot.time_s, robot.yaw
        walk, noise = self._rng.standard_normal(2).tolist()
        self.bias_radps += self._config.bias_walk_radps_per_sqrt_s * math.sqrt(max(span_s, 0.0)) * walk
        rate = rotation / span_s * (1.0 + self._config.scale_error) if span_s > 0.0 else 0.0
        stamp = self._schedule.stamp_ns(now_ns)
        if stamp is None:
            return []
        rate += self.bias_radps + self._config.noise_radps * noise
        return [Imu(stamp, self._config.frame, rate)]
