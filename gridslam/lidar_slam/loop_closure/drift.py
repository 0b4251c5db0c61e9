"""Growth of the front end's errors along its track."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.config import LoopClosureConfig

Floats = NDArray[np.float64]

MIN_STEP_STD_M = 1e-3  # smallest standard deviation of a step, as of a rotation on the spot
MIN_STEP_STD_RAD = 1e-4


@dataclass(frozen=True, slots=True)
class DriftModel:
    """Random walks: standard deviations after one metre of travel, and the heading's per radian of rotation.

    On recorded logs (offices and corridors, 0.3 to 2 km) loops move the track by 0.5 to 1.3 of the standard deviations
    that these numbers predict. `slips` `(n, 3)` are further variances of x, y and yaw of one track's steps, each up to a pose and
    in its frame.
    """

    translation_m: float = 0.02
    rotation_rad: float = 0.003
    rotation_per_rad: float = 0.01
    slips: Floats | None = field(default=None, compare=False)

    @staticmethod
    def of(config: LoopClosureConfig) -> DriftModel:
        """The drift that a config expects."""
        return DriftModel(config.translation_drift_m, config.rotation_drift_rad)

    def cumulative_variances(self, track: Floats) -> Floats:
        """Sums over the steps up to each pose `(n, 3)`: variances of x, y and yaw in the frames of the steps."""
        steps = se2.between(track[:-1], track[1:])
        distance, rotation = np.hypot(steps[:, 0], steps[:, 1]), np.abs(steps[:, 2])
        translation = self.translation_m**2 * distance + MIN_STEP_STD_M**2
        heading = (
            self.rotation_rad**2 * distance + (self.rotation_per_rad * rotation) ** 2 + MIN_STEP_STD_RAD**2
        )
        variances = np.stack([translation, translation, heading], axis=1)
        if self.slips is not None:
            variances += self.slips[1:]
        sums = np.cumsum(variances, axis=0)
        return np.concatenate([np.zeros((1, 3)), sums])
