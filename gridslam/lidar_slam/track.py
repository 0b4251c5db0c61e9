"""The front end's path over all scans, and how corrections of its key scans are spread over it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2

Floats = NDArray[np.float64]


class StepNoise(Protocol):
    """Noise of the front end's motion over one step between key scans: floors, and shares of the motion."""

    @property
    def translation_floor_m(self) -> float: ...
    @property
    def translation_per_m(self) -> float: ...
    @property
    def rotation_floor_rad(self) -> float: ...
    @property
    def rotation_per_rad(self) -> float: ...


@dataclass(frozen=True, slots=True)
class MatchedStepNoise:
    """What matching against surfaces leaves of a step's error."""

    translation_floor_m: float = 0.0015
    translation_per_m: float = 0.005
    rotation_floor_rad: float = 0.001
    rotation_per_rad: float = 0.01


def step_deviations(step: Floats, noise: StepNoise) -> Floats:
    """Standard deviations (x, y, yaw) `(..., 3)` of the front end's motions `(..., 3)` between key scans."""
    way, turn = np.hypot(step[..., 0], step[..., 1]), np.abs(step[..., 2])
    translation = noise.translation_floor_m + noise.translation_per_m * way
    rotation = noise.rotation_floor_rad + noise.rotation_per_rad * turn
    return np.stack([translation, translation, rotation], axis=-1)


def is_far(since: Floats, now: Floats, distance_m: float, turn_rad: float) -> bool:
    """Whether a robot has come this far, or turned this much, from one pose `(3,)` to another: a new key scan is due."""
    moved = se2.between(since, now)
    return float(np.hypot(moved[0], moved[1])) > distance_m or abs(float(moved[2])) > turn_rad


def spread_corrections(track: Floats, keys: NDArray[np.int64], key_poses: Floats) -> Floats:
    """Poses `(n, 3)` of all scans, given the front end's `track` `(n, 3)` and the final poses of its key scans.

    Between two key scans the front end's motion is kept, and what is missing at the second one is shared out
    evenly over the scans. `keys` are the rows of the key scans; the first scan is one.
    """
    out = np.empty_like(track)
    ends = np.append(keys[1:], len(track))
    for index, (first, end) in enumerate(zip(keys, ends, strict=True)):
        segment = se2.compose(key_poses[index], se2.between(track[first], track[first:end]))
        if index + 1 < len(keys):
            arrived = se2.compose(key_poses[index], se2.between(track[first], track[end]))
            missing = se2.between(arrived, key_poses[index + 1])
            share = np.arange(end - first) / (end - first)
            segment = se2.compose(segment, missing * share[:, None])
        out[first:end] = segment
    return out
