"""Who drives: somebody that sees where the robot is and steers it from way point to way point."""

from __future__ import annotations

import math

from gridslam.simulation.drive import STEP_S, DrivenRobot
from gridslam.simulation.robot_config import Robot

SHARP_TURN_RAD = 0.6  # above this the robot turns on the spot
HEADING_GAIN = 1.5  # 1/s
BRAKE_SHARE = 0.7  # of the drive's acceleration, used to slow down before a way point


class RouteDriver:
    """Wheel speeds that lead along the route; `reached` counts the way points behind the robot."""

    def __init__(self, config: Robot) -> None:
        self.config = config
        self.route = config.route * config.laps
        self.reached = 0
        self._wait_s = config.wait_at_start_s
        self._way_of_last_stop_m = -math.inf
        self.wants_sweep = False

    @property
    def finished(self) -> bool:
        """Whether the last way point was reached."""
        return self.reached >= len(self.route) and self._wait_s <= 0.0

    def command(self, robot: DrivenRobot, is_sweeping: bool) -> tuple[float, float]:
        """Left and right wheel speed (rad/s) for the next step."""
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
        return robot.way_m + braking_m - self._way_of_last_stop_m >= stops.every_m

    def _stop(self, robot: DrivenRobot) -> tuple[float, float]:
        """Brake; standing, ask for the sweep and let the robot settle."""
        if robot.left_radps == 0.0 and robot.right_radps == 0.0:
            self._way_of_last_stop_m = robot.way_m
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
        most_turn = self.config.turn_radps
        braking = BRAKE_SHARE * robot.wheels.acceleration_mps2 / robot.wheels.base_m * 2.0
        turn = min(HEADING_GAIN * abs(bearing), math.sqrt(2.0 * braking * abs(bearing)), most_turn)
        turn = math.copysign(turn, bearing)
        forward = 0.0
        if abs(bearing) < SHARP_TURN_RAD:
            slow = math.sqrt(2.0 * BRAKE_SHARE * robot.wheels.acceleration_mps2 * distance)
            forward = (
                min(self.config.speed_mps, slow) * math.cos(bearing) * (1.0 - abs(bearing) / SHARP_TURN_RAD)
            )
        return wheel_speeds(robot, forward, turn)


class PathDriver:
    """Wheel speeds that follow a driven path, whatever becomes of it: nobody corrects what slip does."""

    wants_sweep = False

    def __init__(self, config: Robot) -> None:
        self.route = config.path * config.laps
        self.reached = 0
        self._left_s = config.wait_at_start_s
        self._is_waiting = True

    @property
    def finished(self) -> bool:
        """Whether the last part is driven."""
        return self.reached >= len(self.route) and not self._is_waiting

    def command(self, robot: DrivenRobot, is_sweeping: bool) -> tuple[float, float]:
        """Left and right wheel speed (rad/s) for the next step."""
        self._left_s -= STEP_S
        if self._is_waiting:
            if self._left_s <= 0.0:
                self._is_waiting = False
                self._left_s = self.route[0].seconds if self.route else 0.0
            return 0.0, 0.0
        part = self.route[self.reached]
        if self._left_s <= 1e-9:
            self.reached += 1
            self._left_s = self.route[self.reached].seconds if self.reached < len(self.route) else 0.0
        return wheel_speeds(robot, part.forward_mps, part.turn_radps)


def wheel_speeds(robot: DrivenRobot, forward_mps: float, turn_radps: float) -> tuple[float, float]:
    """Left and right wheel speed (rad/s) of a motion, by the maker's figures."""
    half = 0.5 * turn_radps * robot.wheels.base_m
    return (forward_mps - half) / robot.wheels.radius_m, (forward_mps + half) / robot.wheels.radius_m
