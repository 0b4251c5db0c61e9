"""A drive along the route of a world file, as a stream of events with the ground truth."""

from __future__ import annotations

from collections.abc import Iterator

from gridslam.core.errors import ConfigError
from gridslam.core.messages import Event
from gridslam.simulation.driving.driver import PathDriver, RouteDriver
from gridslam.simulation.simulator import Simulator
from gridslam.simulation.work import MAX_WORK_S, longest_drive_s

TRUTH_EVERY_STEPS = 10


def drive_route(simulator: Simulator) -> Iterator[tuple[Event, bool]]:
    """All events of the drive, each with a flag: true for the ground truth (Odometry in the frame `map`, ten times a second).

    Raises ConfigError: a waypoint is not reached within the world's `max_duration_s`, or before the work is too much.
    """
    longest_s = longest_drive_s(simulator.world)
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
        if simulator.time_s > longest_s:
            raise _too_long(simulator, driver.reached)


def _too_long(simulator: Simulator, reached: int) -> ConfigError:
    robot, limit_s = simulator.world.robot, longest_drive_s(simulator.world)
    if limit_s < simulator.world.max_duration_s:
        return ConfigError(
            f"the drive is not over after {limit_s:.0f} s, whose simulation takes some {MAX_WORK_S / 60.0:g} minutes; "
            "shorten it, or lower the rates and sizes of its sensors"
        )
    if robot.path:
        return ConfigError(f"robot.path: takes longer than {limit_s:g} s; shorten it or raise max_duration_s")
    points = robot.route * robot.laps
    x, y = points[min(reached, len(points) - 1)] if points else robot.start[:2]
    return ConfigError(
        f"robot.route: waypoint {reached} at ({x:g}, {y:g}) is not reached within {limit_s:g} s; "
        "check the route or raise max_duration_s"
    )
