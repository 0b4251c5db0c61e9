"""Where the robot has been, to be asked for by position."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.handmap_slam.drawing_pose import DrawingPose

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Been:
    """Where the robot was: in the front end's frame `(3,)`, along its way, and in the drawing."""

    track_pose: Floats
    travelled_m: float
    pose: DrawingPose


class Places:
    """All that was, in square bins: asking takes as long in a long log as in a short one."""

    def __init__(self, bin_m: float) -> None:
        self._bin_m = bin_m
        self._bins: dict[tuple[int, int], list[Been]] = defaultdict(list)

    def add(self, been: Been) -> None:
        """Remember a place."""
        self._bins[self._bin(been.track_pose)].append(been)

    def near(self, track_pose: Floats, reach_m: float) -> list[Been]:
        """What was within a reach (at most the bin's size) of a pose `(3,)`, in the order of the bins and of time."""
        col, row = self._bin(track_pose)
        x, y = float(track_pose[0]), float(track_pose[1])
        return [
            been
            for key in ((col + dc, row + dr) for dc in (-1, 0, 1) for dr in (-1, 0, 1))
            if key in self._bins
            for been in self._bins[key]
            if math.hypot(float(been.track_pose[0]) - x, float(been.track_pose[1]) - y) < reach_m
        ]

    def _bin(self, pose: Floats) -> tuple[int, int]:
        return math.floor(float(pose[0]) / self._bin_m), math.floor(float(pose[1]) / self._bin_m)
