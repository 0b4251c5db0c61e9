"""Drivers: wheel commands from the true pose along a route of waypoints, or open loop along a path."""

from __future__ import annotations

import math

from gridslam.simulation.driving.drive import STEP_S, DrivenRobot
from gridslam.simulation.driving.robot_config import Robot

SHARP_CORNER_RAD = 0.6  # at a larger bearing to the waypoint the robot turns on the spot
HEADING_GAIN = 1.5  # 1/s
BRAKE_FRACTION = 0.7  # fraction of the drive's acceleration that is used to slow down before a waypoint


class RouteDriver:
    """Closed-loop driver along the waypoints of a route; `reached` counts the waypoints passed."""

    def __init__(self, config: Robot) -> None:
        self.config = config
        self.route = config.route * config.laps
        self.reached = 0
        self._wait_s = config.wait_at_start_s
        self._last_stop_m = -math.inf
        self.wants_sweep = False

    @property
    def finished(self) -> bool:
        """Whether the last waypoint has been reached."""
        return self.reached >= len(self.route) and self._wait_s <= 0.0

    def command(self, robot: DrivenRobot, is_sweeping: bool) -> tuple[float, float]:
        """Left and right wheel speed (rad/s) of the next step."""
        self.wants_sweep = False
        if self._wait_s > 0.0:
            self._wait_s -= STEP_S
            return 0.0, 0.0
        if is_sweeping:
            return 0.0, 0.0
        if self._must_stop(robot):
            return self._stop(robot)
        while self.reached < len(self.route) and self._distance(robot) < self.config.arrival_m:
            self.reached += 1
        if self.reached >= len(self.route):
            self._wait_s = 0.0
            return 0.0, 0.0
        return self._steer(robot)

    def _must_stop(self, robot: DrivenRobot) -> bool:
        stops = self.config.stops
        if stops is None:
            return False
        braking_m = robot.v_mps**2 / (2.0 * robot.wheels.acceleration_mps2)
        return robot.distance_m + braking_m - self._last_stop_m >= stops.every_m

    def _stop(self, robot: DrivenRobot) -> tuple[float, float]:
        """Brake. Once the robot stands, request a sweep and wait until the robot has settled."""
        if robot.left_radps == 0.0 and robot.right_radps == 0.0:
            self._last_stop_m = robot.distance_m
            self._wait_s = self.config.stops.settle_s if self.config.stops else 0.0
            self.wants_sweep = True
        return 0.0, 0.0

    def _distance(self, robot: DrivenRobot) -> float:
        x, y = self.route[self.reached]
        return math.hypot(x - robot.x, y - robot.y)

    def _steer(self, robot: DrivenRobot) -> tuple[float, float]:
        x, y = self.route[self.reached]
        distance = self._distance(robot)
        bearing = math.remainder(math.atan2(y - robot.y, x - robot.x) - robot.yaw, math.tau)
        max_rate = self.config.turn_radps
        braking = BRAKE_FRACTION * robot.wheels.acceleration_mps2 / robot.wheels.base_m * 2.0
        rate = min(HEADING_GAIN * abs(bearing), math.sqrt(2.0 * braking * abs(bearing)), max_rate)
        rate = math.copysign(rate, bearing)
        forward = 0.0
        if abs(bearing) < SHARP_CORNER_RAD:
            stopping = math.sqrt(2.0 * BRAKE_FRACTION * robot.wheels.acceleration_mps2 * distance)
            forward = (
                min(self.config.speed_mps, stopping)
                * math.cos(bearing)
                * (1.0 - abs(bearing) / SHARP_CORNER_RAD)
            )
        return wheel_speeds(robot, forward, rate)


class PathDriver:
    """Open-loop driver along `robot.path`: slip is not corrected."""

    wants_sweep = False

    def __init__(self, config: Robot) -> None:
        self.route = config.path * config.laps
        self.reached = 0
        self._remaining_s = config.wait_at_start_s
        self._is_waiting = True

    @property
    def finished(self) -> bool:
        """Whether the last segment has been driven."""
        return self.reached >= len(self.route) and not self._is_waiting

    def command(self, robot: DrivenRobot, is_sweeping: bool) -> tuple[float, float]:
        """Left and right wheel speed (rad/s) of the next step."""
        self._remaining_s -= STEP_S
        if self._is_waiting:
            if self._remaining_s <= 0.0:
                self._is_waiting = False
                self._remaining_s = self.route[0].seconds if self.route else 0.0
            return 0.0, 0.0
        segment = self.route[self.reached]
        if self._remaining_s <= 1e-9:
            self.reached += 1
            self._remaining_s = self.route[self.reached].seconds if self.reached < len(self.route) else 0.0
        return wheel_speeds(robot, segment.forward_mps, segment.turn_radps)


def wheel_speeds(robot: DrivenRobot, forward_mps: float, turn_radps: float) -> tuple[float, float]:
    """Left and right wheel speed (rad/s) for a forward speed and a yaw rate, by the nominal wheel radius and base."""
    half = 0.5 * turn_radps * robot.wheels.base_m
    return (forward_mps - half) / robot.wheels.radius_m, (forward_mps + half) / robot.wheels.radius_m
