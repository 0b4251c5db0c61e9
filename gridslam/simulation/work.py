"""The work of simulating a world, which is bounded before it starts and while it goes on.

The figures are the CPU time (s) of one core, measured on worlds with 10,000 beams, pictures of 1600 x 1200 pixels, 1,000 objects
and 500 people. They are rough: what they bound is the order of magnitude.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gridslam.core.errors import ConfigError
from gridslam.simulation.driving.robot_config import route_length_m
from gridslam.simulation.sensors.camera_config import StereoCamera

if TYPE_CHECKING:
    from gridslam.simulation.world_config import WorldConfig

MAX_SLOWDOWN = 120.0  # CPU time of a simulated second, in seconds
MAX_WORK_S = 3600.0  # CPU time of a drive

STEPS_S = 0.01  # CPU time of a simulated second without sensors but odometry
PIXEL_S, BEAM_S, READING_S = 8e-7, 8e-7, 2e-6
CROSSING_S = 2e-9  # CPU time of a ray with a side of an object or a leg, which are tried one by one
RAYS_PER_BEAM, SIDES, LEGS = 3, 4, 2
PERSON_SCAN_S, TAG_ROUND_S = 4e-5, 3e-5
PERSON_FRAME_S, OBJECT_FRAME_S, FIXED_FRAME_S = 5e-4, 2e-4, 6e-5  # their triangles in a picture
MOVE_S = 1e-5  # CPU time of an object at a waypoint
ADVICE = "lower rate_hz, the pixels or beams, or the number of objects and people"


def work_per_second(world: WorldConfig) -> dict[str, float]:
    """CPU time (s) of a simulated second by the part of the world that causes it."""
    people, objects = len(world.people), len(world.movable_objects)
    fixed = len(world.boxes) + len(world.cylinders) + sum(max(len(w.points), SIDES) for w in world.walls)
    frame_s = people * PERSON_FRAME_S + objects * OBJECT_FRAME_S + fixed * FIXED_FRAME_S
    work = {"steps": STEPS_S}
    for camera in [*world.sensors.cameras, *world.fixed_cameras]:
        views = 2 if isinstance(camera, StereoCamera) else 1
        pixels = camera.width_px * camera.height_px
        work[f"camera {camera.name}"] = views * camera.rate_hz * (pixels * PIXEL_S + frame_s)
    if lidar := world.sensors.lidar:
        shapes = objects * SIDES + people * LEGS + len(world.cylinders)
        beam_s = BEAM_S + RAYS_PER_BEAM * shapes * CROSSING_S
        work["lidar"] = lidar.rate_hz * (lidar.beams * beam_s + people * PERSON_SCAN_S)
    tags = sum(obj.tag is not None for obj in world.movable_objects)
    if tags and world.sensors.antennas:
        work["antennas"] = tags * TAG_ROUND_S * sum(antenna.rate_hz for antenna in world.sensors.antennas)
    return work


def shortest_drive_s(world: WorldConfig) -> float:
    """Time (s) that the drive takes at least: at full speed, without turning on the spot."""
    robot = world.robot
    if robot.path:
        return robot.laps * sum(segment.seconds for segment in robot.path)
    length_m = route_length_m(robot)
    drive_s = robot.wait_at_start_s + length_m / min(robot.speed_mps, robot.wheels.max_speed_mps)
    return drive_s + _sweeps(world) * (robot.stops.settle_s if robot.stops else 0.0)


def longest_drive_s(world: WorldConfig) -> float:
    """Time (s) after which a drive is given up: `max_duration_s`, or when its work has reached the limit."""
    return min(world.max_duration_s, MAX_WORK_S / sum(work_per_second(world).values()))


def refuse_slow(world: WorldConfig) -> None:
    """Raise ValueError if a simulated second takes more than MAX_SLOWDOWN of CPU time."""
    work = work_per_second(world)
    if sum(work.values()) > MAX_SLOWDOWN:
        raise ValueError(
            f"a second of the drive takes some {sum(work.values()):.0f} s to simulate, most of them for {_largest(work)}; "
            f"at most {MAX_SLOWDOWN:g} s are spent: {ADVICE}"
        )


def refuse_long(world: WorldConfig) -> None:
    """Raise ConfigError if the drive takes more than MAX_WORK_S of CPU time."""
    drive_s = min(shortest_drive_s(world), world.max_duration_s)
    work = {name: drive_s * second_s for name, second_s in work_per_second(world).items()}
    waypoints = world.robot.laps * max(len(world.robot.route), len(world.robot.path))
    work["objects at waypoints"] = waypoints * len(world.movable_objects) * MOVE_S
    readings = sum((r.to_deg - r.from_deg) / r.step_deg + 1 for r in world.sensors.infrared)
    work["infrared"] = _sweeps(world) * readings * READING_S
    if sum(work.values()) > MAX_WORK_S:
        raise ConfigError(
            f"the drive of {drive_s:.0f} s or more takes some {sum(work.values()) / 60.0:.0f} minutes to simulate, most of them "
            f"for {_largest(work)}; at most {MAX_WORK_S / 60.0:g} minutes are spent: shorten it, or {ADVICE}"
        )


def _largest(work: dict[str, float]) -> str:
    return max(work, key=lambda name: work[name])


def _sweeps(world: WorldConfig) -> float:
    """The number of stops for sweeps of the infrared rangers."""
    stops = world.robot.stops
    return route_length_m(world.robot) / stops.every_m if stops else 0.0
