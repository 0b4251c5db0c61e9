"""A whole drive along the route of the world file, as a stream of events with the truth."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event
from gridslam.simulation.driver import RouteDriver
from gridslam.simulation.robot_config import Robot
from gridslam.simulation.simulator import Simulator

TRUTH_EVERY_STEPS = 10


def drive_route(simulator: Simulator) -> Iterator[tuple[Event, bool]]:
    """All events of the drive, each with whether it is the truth (an Odometry in the frame `map`, ten times a second).

    Raises ConfigError where a way point is not reached within the world's `max_duration_s`.
    """
    yield from ((mount, False) for mount in simulator.mounts())
    yield simulator.truth(), True
    driver = RouteDriver(simulator.world.robot)
    reached, steps = 0, 0
    while not driver.finished:
        command = driver.command(simulator.robot, simulator.is_sweeping)
        while reached < driver.reached:
            simulator.scene.reach(reached)
            reached += 1
        yield from ((event, False) for event in simulator.step(*command))
        if driver.wants_sweep:
            simulator.start_sweep()
        steps += 1
        if steps % TRUTH_EVERY_STEPS == 0:
            yield simulator.truth(), True
        if simulator.time_s > simulator.world.max_duration_s:
            x, y = driver.route[min(driver.reached, len(driver.route) - 1)]
            raise ConfigError(
                f"robot.route: way point {driver.reached} at ({x:g}, {y:g}) is not reached within "
                f"{simulator.world.max_duration_s:g} s; check the way or raise max_duration_s"
            )


def route_length_m(robot: Robot) -> float:
    """Length of the way from the start through all way points, in all laps."""
    points = np.array([robot.start[:2], *(robot.route * robot.laps)])
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
