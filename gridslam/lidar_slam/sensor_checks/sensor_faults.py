"""The faults of the sensors of a log, and how they are corrected."""

from __future__ import annotations

from dataclasses import dataclass, field

from gridslam.lidar_slam.sensor_checks.extrinsics_calibration import ExtrinsicsCheck
from gridslam.lidar_slam.sensor_checks.gyro_calibration import GyroCorrection
from gridslam.lidar_slam.sensor_checks.odometry_correction import OdometryCorrection
from gridslam.lidar_slam.sensor_checks.scan_repairs import ScanRepairs


@dataclass(slots=True)
class SensorFaults:
    """Corrections of the odometry, of the yaw rates (None if they are right or missing), of scans, and of the extrinsics."""

    odometry: OdometryCorrection = field(default_factory=OdometryCorrection)
    gyro: GyroCorrection | None = None
    scans: ScanRepairs = field(default_factory=ScanRepairs)
    extrinsics: ExtrinsicsCheck = field(default_factory=ExtrinsicsCheck)

    @property
    def notes(self) -> list[str]:
        """One line for the user about each fault; empty for a good log."""
        gyro = [self.gyro.note] if self.gyro is not None and self.gyro.is_fault else []
        return [*self.odometry.notes, *gyro, *self.extrinsics.notes, *self.scans.notes]
