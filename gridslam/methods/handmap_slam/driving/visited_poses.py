"""Poses that the robot has visited, indexed by position."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.handmap_slam.drawing_pose import DrawingPose

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class VisitedPose:
    """A pose of the front end `(3,)`, the distance travelled up to there, and the pose in the drawing."""

    track_pose: Floats
    travelled_m: float
    pose: DrawingPose


class VisitedPoses:
    """All visited poses in square bins, so that a query takes no longer in a long log than in a short one."""

    def __init__(self, bin_m: float) -> None:
        self._bin_m = bin_m
        self._bins: dict[tuple[int, int], list[VisitedPose]] = defaultdict(list)

    def add(self, visited: VisitedPose) -> None:
        """Store a pose."""
        self._bins[self._bin(visited.track_pose)].append(visited)

    def near(self, track_pose: Floats, radius_m: float) -> list[VisitedPose]:
        """The poses within a radius (at most a bin's size) of a pose `(3,)`, ordered by bin and time."""
        col, row = self._bin(track_pose)
        x, y = float(track_pose[0]), float(track_pose[1])
        return [
            visited
            for key in ((col + dc, row + dr) for dc in (-1, 0, 1) for dr in (-1, 0, 1))
            if key in self._bins
            for visited in self._bins[key]
            if math.hypot(float(visited.track_pose[0]) - x, float(visited.track_pose[1]) - y) < radius_m
        ]

    def _bin(self, pose: Floats) -> tuple[int, int]:
        return math.floor(float(pose[0]) / self._bin_m), math.floor(float(pose[1]) / self._bin_m)
