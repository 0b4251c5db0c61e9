"""Errors of odometry, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.lidar_slam.sensor_checks.heading_errors import NO_ERRORS, HeadingErrors

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class OdometryCorrection:
    """Correction of odometry: it is `lag_s` late, its translation must be multiplied by `scale`, its yaw perhaps mirrored.

    `mirrors_y`: the path is mirrored as well as the yaw, as by exchanged wheels. `heading`: errors of its rotations, which
    deform the path. `distance_ratio`: distances by the lidar, relative to those by odometry, that differ by too little to be
    corrected; 1 without evidence. `is_undecided`: more motion may show a lag. `is_imu_with_scans`: an IMU turns as the scans say.
    `possible_lags_s` are the smallest and largest lags that the motion does not rule out; None where the robot turned too little.
    """

    lag_s: float = 0.0
    scale: float = 1.0
    mirrors_yaw: bool = False
    mirrors_y: bool = False
    heading: HeadingErrors = NO_ERRORS
    distance_ratio: float = 1.0
    is_undecided: bool = False
    is_imu_with_scans: bool = False
    possible_lags_s: tuple[float, float] | None = None

    @property
    def faults(self) -> list[str]:
        """The faults in words; empty for good odometry."""
        found = []
        if self.mirrors_yaw:
            found.append(self._mirrored_in_words)
        if self.lag_s:
            found.append(f"it is {abs(self.lag_s):.2f} s {'late' if self.lag_s > 0 else 'early'}")
        if self.scale != 1.0:
            found.append(
                f"its distances are {1.0 / self.scale:.3g} of the true ones (or the lidar's ranges {self.scale:.3g})"
            )
        return [*found, *self.heading.faults]

    @property
    def _mirrored_in_words(self) -> str:
        """The mirrored parts in words: a lidar that hangs upside down mirrors the path as well as the yaw."""
        if not self.mirrors_y:
            return "its yaw has the wrong sign"
        wheels = "its yaw and y have the wrong sign (exchanged wheels, or a turn rate of the wrong sign)"
        if not self.may_be_lidar:
            return f"{wheels}, by the IMU as well"
        return (
            f"{wheels}, or else the lidar's beams "
            "are mirrored (it hangs upside down), and then so is the map: log.extrinsics with roll: 3.1416 mirrors them back"
        )

    @property
    def may_be_lidar(self) -> bool:
        """Whether the odometry is the mirror image of the scans, and no IMU says which of both is wrong."""
        return self.mirrors_yaw and self.mirrors_y and not self.is_imu_with_scans

    @property
    def doubt(self) -> str | None:
        """The reason, in words, to distrust the map; None without one."""
        if not self.may_be_lidar:
            return None
        return (
            "odometry and scans are mirror images of each other: if the map is a mirror image of the building, the lidar hangs "
            "upside down (log.extrinsics with roll: 3.1416 turns it over); if not, the odometry is wrong "
            "(log.topics: {odom: []} leaves it out)"
        )

    @property
    def notes(self) -> list[str]:
        """Lines for the user: the faults, which are corrected, and distances that differ; none for good odometry."""
        found = (
            [f"odometry contradicts the scans: {', '.join(self.faults)}; used corrected"]
            if self.faults
            else []
        )
        if self.distance_ratio != 1.0:
            found.append(
                f"distances by odometry are {1.0 / self.distance_ratio:.3g} of those by the lidar, which are taken as right: if "
                f"a length in the map is {self.distance_ratio:.3g} of the true one, the lidar's ranges are wrong"
            )
        return found

    def poses(self, poses: Floats) -> Floats:
        """Odometry poses `(..., 3)` without the wrong scale and signs."""
        y = -self.scale if self.mirrors_y else self.scale
        return np.asarray(poses * np.array([self.scale, y, -1.0 if self.mirrors_yaw else 1.0]))
