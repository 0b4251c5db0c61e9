"""Key scans: when one is due, the noise of the steps between them, and how their corrections move all other scans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class StepNoise:
    """Noise of the front end's motion between two key scans: floors, and standard deviation per unit of motion.

    The defaults are what matching against surfaces leaves of a step's error.
    """

    translation_floor_m: float = 0.0015
    translation_per_m: float = 0.005
    rotation_floor_rad: float = 0.001
    rotation_per_rad: float = 0.01

    def std(self, step: Floats) -> Floats:
        """Standard deviations (x, y, yaw) `(..., 3)` of motions `(..., 3)`."""
        distance_m, rotation_rad = np.hypot(step[..., 0], step[..., 1]), np.abs(step[..., 2])
        translation = self.translation_floor_m + self.translation_per_m * distance_m
        rotation = self.rotation_floor_rad + self.rotation_per_rad * rotation_rad
        return np.stack([translation, translation, rotation], axis=-1)


@dataclass(frozen=True, slots=True)
class KeyScanSpacing:
    """A key scan is due after this much travel (m) or rotation (rad)."""

    distance_m: float
    rotation_rad: float

    def is_due(self, last_key_pose: Floats, pose: Floats) -> bool:
        """Whether the robot has moved far enough from the pose `(3,)` at the last key scan."""
        x, y, yaw = se2.between(last_key_pose, pose).tolist()
        return math.hypot(x, y) > self.distance_m or abs(yaw) > self.rotation_rad


def distribute_corrections(track: Floats, keys: NDArray[np.int64], key_poses: Floats) -> Floats:
    """Poses `(n, 3)` of all scans, given the front end's `track` `(n, 3)` and the final poses `(k, 3)` of the key scans.

    `keys` `(k,)` are the rows of the key scans; the first scan is one. Between two key scans the front end's motion is kept,
    and the correction at the second one is distributed evenly over the scans.
    """
    if not len(keys):
        return track.copy()
    # The key scan at or before each scan, among the key scans.
    owner = np.searchsorted(keys, np.arange(len(track)), side="right") - 1
    from_key = np.array([se2.inverse(pose) for pose in track[keys]])[owner]
    poses = se2.compose(key_poses[owner], se2.compose(from_key, track))
    corrections = [
        se2.between(se2.compose(key_poses[k], se2.between(track[first], track[end])), key_poses[k + 1])
        for k, (first, end) in enumerate(pairwise(keys))
    ]
    if corrections:
        between = slice(0, keys[-1])  # behind the last key scan there is nothing to distribute
        row = owner[between]
        fraction = (np.arange(keys[-1]) - keys[row]) / np.diff(keys)[row]
        poses[between] = se2.compose(poses[between], np.array(corrections)[row] * fraction[:, None])
    return poses
