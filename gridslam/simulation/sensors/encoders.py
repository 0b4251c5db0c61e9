"""Wheel odometry: wheel angles in whole ticks, and the pose integrated from them with the nominal radius and wheel base."""

from __future__ import annotations

import math

import numpy as np

from gridslam.core.messages import Event, Odometry, WheelTicks, canonical_yaw
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.sensor_config import WheelOdometry
from gridslam.simulation.sensors.timing import Schedule

ODOM_FRAME, BASE_FRAME = "odom", "base_link"


class Encoders:
    """Dead reckoning from quantised wheel angles."""

    def __init__(self, config: WheelOdometry, start_ns: int, rng: np.random.Generator) -> None:
        self._config = config
        self._schedule = Schedule(config, start_ns, rng)
        self._pose = [0.0, 0.0, 0.0]
        self._last_wheels = (0.0, 0.0)
        self._last_s = 0.0

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The messages of this step: none if no measurement is due, or if they are lost."""
        if not self._schedule.is_due(now_ns):
            return []
        self._schedule.advance()
        wheels = (self._quantised(robot.left_rad), self._quantised(robot.right_rad))
        v, w = self._advance(wheels, robot)
        stamp = self._schedule.stamp_ns(now_ns)
        if stamp is None:
            return []
        events: list[Event] = []
        if self._config.publish_wheels:
            events.append(WheelTicks(stamp, BASE_FRAME, *wheels))
        if self._config.publish_odometry:
            x, y, yaw = self._pose
            events.append(
                Odometry(
                    stamp,
                    ODOM_FRAME,
                    x_m=x,
                    y_m=y,
                    yaw_rad=canonical_yaw(yaw),
                    vx_mps=v,
                    wz_radps=w,
                    child_frame_id=BASE_FRAME,
                )
            )
        return events

    def _quantised(self, angle_rad: float) -> float:
        """A wheel's angle rounded down to whole ticks; unchanged if the encoders have no ticks (0 per revolution)."""
        ticks = self._config.ticks_per_revolution
        return math.floor(angle_rad * ticks / math.tau) * math.tau / ticks if ticks else angle_rad

    def _advance(self, wheels: tuple[float, float], robot: DrivenRobot) -> tuple[float, float]:
        """Move the pose along the arc between the last wheel angles (rad) and these; returns speed (m/s) and yaw rate (rad/s)."""
        radius, base = robot.wheels.radius_m, robot.wheels.base_m
        left, right = ((new - old) * radius for new, old in zip(wheels, self._last_wheels, strict=True))
        forward, rotation = 0.5 * (left + right), (right - left) / base
        x, y, yaw = self._pose
        chord = forward * (math.sin(0.5 * rotation) / (0.5 * rotation) if rotation else 1.0)
        x += chord * math.cos(yaw + 0.5 * rotation)
        y += chord * math.sin(yaw + 0.5 * rotation)
        self._pose = [x, y, math.remainder(yaw + rotation, math.tau)]
        span_s = robot.time_s - self._last_s
        self._last_wheels, self._last_s = wheels, robot.time_s
        return (forward / span_s, rotation / span_s) if span_s > 0.0 else (0.0, 0.0)
