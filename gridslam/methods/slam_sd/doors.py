"""Doors: the heading of the closed leaf, from the wall in which it hinges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.walls import Walls

Floats = NDArray[np.float64]

FLUSH = 0.985  # cosine of 10 degrees: a leaf that is flush with its wall is closed
HINGE_REACH_M = 0.15  # from the plane of a wall


def closed_yaw_of(leaf: Floats, walls: Walls, known: float | None) -> float | None:
    """The heading (rad) of the closed leaf, given where the leaf is (3,), in the same frame.

    It is that direction of the wall about the hinge which is nearest to `known`, what was found before, else to the leaf: without
    other knowledge no door is taken to be open by more than 90 degrees. None without a wall.
    """
    if not len(walls):
        return known
    distance = np.abs(walls.signed_distances(leaf[None, :2])[0])
    nearest = int(np.argmin(distance))
    if not distance[nearest] < HINGE_REACH_M:
        return known
    line = float(walls.directions[nearest])
    near = float(leaf[2])
    if known is not None and abs(np.cos(line - near)) < FLUSH:
        near = known
    return line if np.cos(line - near) >= 0.0 else float(se2.wrap_angle(line + np.pi))
