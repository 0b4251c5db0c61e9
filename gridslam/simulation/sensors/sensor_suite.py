"""The section `sensors` of a world file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from gridslam.config.base import StrictModel
from gridslam.simulation.sensors.camera_config import AnyCamera
from gridslam.simulation.sensors.sensor_config import (
    AbsolutePoses,
    Antenna,
    Gyro,
    Infrared,
    Lidar,
    WheelOdometry,
)


class Sensors(StrictModel):
    """The sensors on board."""

    former_keys: ClassVar[Mapping[str, str]] = {"fixes": "absolute_poses"}

    lidar: Lidar | None = None
    odometry: WheelOdometry | None = WheelOdometry()
    gyro: Gyro | None = None
    infrared: tuple[Infrared, ...] = ()
    antennas: tuple[Antenna, ...] = ()
    absolute_poses: AbsolutePoses | None = None
    cameras: tuple[AnyCamera, ...] = ()
