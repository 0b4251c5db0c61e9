"""The section `sensors` of a world file as a whole."""

from __future__ import annotations

from gridslam.config.base import StrictModel
from gridslam.simulation.camera_config import AnyCamera
from gridslam.simulation.sensor_config import Antenna, Fixes, Gyro, Infrared, Lidar, WheelOdometry


class Sensors(StrictModel):
    """Everything on board."""

    lidar: Lidar | None = None
    odometry: WheelOdometry | None = WheelOdometry()
    gyro: Gyro | None = None
    infrared: tuple[Infrared, ...] = ()
    antennas: tuple[Antenna, ...] = ()
    fixes: Fixes | None = None
    cameras: tuple[AnyCamera, ...] = ()
