"""The simulator as a closed loop: command wheel speeds, step, take the sensors' messages.

simulator = Simulator(world, folder)
for event in simulator.step(left_radps, right_radps): ...
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from gridslam.core.messages import Event, Odometry, Transform, canonical_yaw
from gridslam.core.random import random_stream
from gridslam.simulation.driving.drive import STEP_NS, DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.absolute_poses import AbsolutePoseSource
from gridslam.simulation.sensors.camera_config import RgbdCamera, StereoCamera
from gridslam.simulation.sensors.cameras import CameraSensor
from gridslam.simulation.sensors.encoders import BASE_FRAME, Encoders
from gridslam.simulation.sensors.extrinsics import static_transform
from gridslam.simulation.sensors.gyro import GyroSensor
from gridslam.simulation.sensors.infrared import InfraredRangers
from gridslam.simulation.sensors.lidar import LidarSensor
from gridslam.simulation.sensors.rfid import RfidReader
from gridslam.simulation.world_config import WorldConfig

MAP_FRAME = "map"
POSE_STREAM = "fixes"  # names the random stream of absolute poses: another name would change recorded logs


class Sensor(Protocol):
    """A source of messages."""

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The messages that become available at this step."""


class Simulator:
    """A world, a robot and its sensors, advanced in steps of 10 ms. Same world and commands give the same events."""

    step_s = STEP_NS * 1e-9

    def __init__(self, world: WorldConfig, folder: Path) -> None:
        self.world = world
        self.scene = Scene(world, folder)
        self.robot = DrivenRobot(world.robot.wheels, world.robot.start, random_stream(world.seed, "wheels"))
        self._now_ns = 0
        self._rangers = InfraredRangers(
            world.sensors.infrared, world.start_ns, random_stream(world.seed, "infrared")
        )
        self._cameras = _cameras(world, folder, world.sensors.cameras, is_fixed=False)
        self._fixed_cameras = _cameras(world, folder, world.fixed_cameras, is_fixed=True)
        self._sensors: list[Sensor] = [*_sensors(world), self._rangers, *self._cameras, *self._fixed_cameras]

    @property
    def time_s(self) -> float:
        """Simulated time (s) since the start."""
        return self._now_ns * 1e-9

    @property
    def is_sweeping(self) -> bool:
        """Whether the infrared rangers are sweeping; the robot must stand meanwhile."""
        return self._rangers.is_sweeping

    def extrinsics(self) -> list[Transform]:
        """Static transforms of all sensors: T_base_sensor, and T_map_camera of fixed cameras."""
        sensors, stamp = self.world.sensors, self.world.start_ns
        sensor_frames = [(sensors.lidar.extrinsics, sensors.lidar.frame)] if sensors.lidar else []
        sensor_frames += [(ranger.extrinsics, ranger.name) for ranger in sensors.infrared]
        sensor_frames += [(antenna.extrinsics, antenna.name) for antenna in sensors.antennas]
        transforms = [static_transform(extrinsics, frame, stamp) for extrinsics, frame in sensor_frames]
        transforms += [camera.extrinsics(stamp, BASE_FRAME) for camera in self._cameras]
        return transforms + [camera.extrinsics(stamp, MAP_FRAME) for camera in self._fixed_cameras]

    def start_sweep(self) -> None:
        """Start one sweep of the infrared rangers."""
        self._rangers.start(self._now_ns, self.robot, self.scene)

    def step(self, left_radps: float, right_radps: float) -> list[Event]:
        """Drive for 10 ms with these wheel speeds (rad/s); returns the messages of all sensors."""
        self.robot.step(left_radps, right_radps)
        self._now_ns += STEP_NS
        events: list[Event] = []
        for sensor in self._sensors:
            events += sensor.poll(self._now_ns, self.robot, self.scene)
        return events

    def truth(self) -> Odometry:
        """The true pose T_map_base, as odometry in the frame `map`."""
        x, y, yaw = self.robot.pose.tolist()
        return Odometry(
            self.world.start_ns + self._now_ns,
            MAP_FRAME,
            x_m=x,
            y_m=y,
            yaw_rad=canonical_yaw(_wrapped(yaw)),
            vx_mps=self.robot.v_mps,
            wz_radps=self.robot.w_radps,
            child_frame_id=BASE_FRAME,
        )


def _wrapped(yaw_rad: float) -> float:
    return math.remainder(yaw_rad, math.tau)


def _cameras(
    world: WorldConfig, folder: Path, configs: Iterable[RgbdCamera | StereoCamera], is_fixed: bool
) -> list[CameraSensor]:
    return [
        CameraSensor(c, world.start_ns, random_stream(world.seed, f"camera {c.name}"), folder, is_fixed)
        for c in configs
    ]


def _sensors(world: WorldConfig) -> list[Sensor]:
    """The sensors of a world, each with a random stream of its own."""
    seed, start, configs = world.seed, world.start_ns, world.sensors
    sensors: list[Sensor] = []
    if configs.odometry:
        sensors.append(Encoders(configs.odometry, start, random_stream(seed, "odometry")))
    if configs.gyro:
        sensors.append(GyroSensor(configs.gyro, start, random_stream(seed, "gyro")))
    if configs.lidar:
        sensors.append(LidarSensor(configs.lidar, start, random_stream(seed, "lidar")))
    readers = ((antenna, random_stream(seed, f"antenna {antenna.name}")) for antenna in configs.antennas)
    sensors += [RfidReader(antenna, start, rng) for antenna, rng in readers]
    if configs.absolute_poses:
        sensors.append(AbsolutePoseSource(configs.absolute_poses, start, random_stream(seed, POSE_STREAM)))
    return sensors
