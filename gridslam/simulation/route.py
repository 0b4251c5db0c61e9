"""A drive along the route of a world file, as a stream of events with the ground truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event
from gridslam.simulation.driver import PathDriver, RouteDriver
from gridslam.simulation.robot_config import Robot
from gridslam.simulation.simulator import Simulator

TRUTH_EVERY_STEPS = 10


def drive_route(simulator: Simulator) -> Iterator[tuple[Event, bool]]:
    """All events of the drive, each with a flag: true for the ground truth (Odometry in the frame `map`, ten times a second).

    Raises ConfigError: a waypoint is not reached within the world's `max_duration_s`.
    """
    yield from ((transform, False) for transform in simulator.extrinsics())
    yield simulator.truth(), True
    robot = simulator.world.robot
    driver = PathDriver(robot) if robot.path else RouteDriver(robot)
    reached, steps = 0, 0
    while not driver.finished:
        command = driver.command(simulator.robot, simulator.is_sweeping)
        while reached < driver.reached:
            simulator.scene.arrive_at_waypoint(reached)
            reached += 1
        yield from ((event, False) for event in simulator.step(*command))
        if driver.wants_sweep:
            simulator.start_sweep()
        steps += 1
        if steps % TRUTH_EVERY_STEPS == 0:
            yield simulator.truth(), True
        if simulator.time_s > simulator.world.max_duration_s:
            raise _too_long(simulator, driver.reached)


def _too_long(simulator: Simulator, reached: int) -> ConfigError:
    robot, limit = simulator.world.robot, simulator.world.max_duration_s
    if robot.path:
        return ConfigError(f"robot.path: takes longer than {limit:g} s; shorten it or raise max_duration_s")
    points = robot.route * robot.laps
    x, y = points[min(reached, len(points) - 1)] if points else robot.start[:2]
    return ConfigError(
        f"robot.route: waypoint {reached} at ({x:g}, {y:g}) is not reached within {limit:g} s; "
        "check the route or raise max_duration_s"
    )


def route_length_m(robot: Robot) -> float:
    """Length (m) of the route from the start through all waypoints, or of the path, over all laps."""
    if robot.path:
        return robot.laps * sum(abs(segment.forward_mps) * segment.seconds for segment in robot.path)
    points = np.array([robot.start[:2], *(robot.route * robot.laps)])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
