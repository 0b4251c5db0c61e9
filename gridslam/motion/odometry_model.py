"""The odometry motion model: turn, drive, turn, each with noise (Thrun et al. 2005, table 5.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]

# Below this the direction of a step is noise, and all of its turning counts as the second turn
_STANDING_M = 0.01


@dataclass(frozen=True, slots=True)
class OdometryNoise:
    """Variances per squared motion: alpha1 turning by turning, alpha2 turning by driving (rad^2/m^2), alpha3 driving by driving,
    alpha4 driving by turning (m^2/rad^2). `wild_fraction` of the samples have `wild_factor` times the deviation: wheels slip.
    """

    alpha1: float
    alpha2: float
    alpha3: float
    alpha4: float
    wild_fraction: float = 0.0
    wild_factor: float = 1.0


def sample_motion(poses: Floats, step: Floats, noise: OdometryNoise, rng: np.random.Generator) -> Floats:
    """Poses `(n, 3)` after an odometry step `(3,)` in the robot's frame, each with noise of its own."""
    distance = float(np.hypot(step[0], step[1]))
    rotation_1 = float(np.arctan2(step[1], step[0])) if distance >= _STANDING_M else 0.0
    rotation_2 = float(se2.wrap_angle(step[2] - rotation_1))
    # Driving backwards is not a turn of half a circle there and back.
    noisy_1, noisy_2 = _smallest_yaw_change(rotation_1), _smallest_yaw_change(rotation_2)
    deviations = np.sqrt(
        [
            noise.alpha1 * noisy_1**2 + noise.alpha2 * distance**2,
            noise.alpha3 * distance**2 + noise.alpha4 * (noisy_1**2 + noisy_2**2),
            noise.alpha1 * noisy_2**2 + noise.alpha2 * distance**2,
        ]
    )
    n = len(poses)
    drawn = rng.standard_normal((3, n)) * deviations[:, None]
    wild = round(noise.wild_fraction * n)
    if wild:
        drawn[:, rng.integers(0, n, wild)] *= noise.wild_factor
    heading = poses[:, 2] + (rotation_1 + drawn[0])
    length = distance + drawn[1]
    x = poses[:, 0] + length * np.cos(heading)
    y = poses[:, 1] + length * np.sin(heading)
    return np.stack([x, y, se2.wrap_angle(heading + (rotation_2 + drawn[2]))], axis=1)


def _smallest_yaw_change(angle_rad: float) -> float:
    """The angle to straight ahead or straight back, whichever is nearer."""
    return min(abs(angle_rad), abs(abs(angle_rad) - np.pi))
