"""Errors of predicted motions by source, and how fast the robot changes its speed, learned from matched scans."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.motion.scan_poses import MAX_SCAN_GAP_S

Floats = NDArray[np.float64]

LEARNED_STEPS = 200  # number of steps over which changes of the velocity are averaged
CHANGE_STDS = 1.5  # the changes are not Gaussian: robots drive evenly and then stop
MIN_TRANSLATION_STD_M = 0.01
MIN_COMPARED_STEPS = 20  # a source is judged by its errors once it has been compared this often


class PredictionErrors:
    """Root mean square differences between predicted and matched motions of one source."""

    def __init__(self) -> None:
        self.steps = 0
        self._squares_m2 = self._squares_rad2 = 0.0

    def add(self, predicted: Floats, matched: Floats) -> None:
        """Add a step `(3,)` by the source and by matching, both in the robot's frame."""
        x, y, yaw = (predicted - matched).tolist()
        self._squares_m2 += x * x + y * y
        self._squares_rad2 += math.remainder(yaw, 2.0 * math.pi) ** 2
        self.steps += 1

    @property
    def rms_m(self) -> float:
        """Root mean square error of the translation of a step (m)."""
        return math.sqrt(self._squares_m2 / max(self.steps, 1))

    @property
    def rms_rad(self) -> float:
        """Root mean square error of the heading of a step (rad)."""
        return math.sqrt(self._squares_rad2 / max(self.steps, 1))

    def measures(self) -> dict[str, object]:
        """The errors for the report."""
        return {
            "compared_scans": self.steps,
            "rms_error_m": round(self.rms_m, 4),
            "rms_error_rad": round(self.rms_rad, 5),
        }


class VelocityChange:
    """Change of the robot's speed from scan to scan, learned from matches that are certain in all directions."""

    def __init__(self) -> None:
        self._steps = 0
        self._mean_square = 0.0  # (m/s)^2

    def add(self, difference_m: float, elapsed_s: float) -> None:
        """Add a position's distance from its prediction at constant velocity over `elapsed_s`."""
        self._steps += 1
        weight = 1.0 / min(self._steps, LEARNED_STEPS)
        self._mean_square += weight * ((difference_m / elapsed_s) ** 2 - self._mean_square)

    def std_m(self, elapsed_s: float) -> float:
        """Standard deviation (m) of the translation over `elapsed_s`; infinite while little is known, or after a gap."""
        if self._steps < MIN_COMPARED_STEPS or elapsed_s > MAX_SCAN_GAP_S:
            return math.inf
        return MIN_TRANSLATION_STD_M + CHANGE_STDS * math.sqrt(self._mean_square) * elapsed_s
