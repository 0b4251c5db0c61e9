"""Doors: the heading of the closed leaf, from the wall in which it hinges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.methods.slam_sd.objects.walls import Walls

Floats = NDArray[np.float64]

MIN_FLUSH_COS = 0.985  # cosine of 10 degrees: a leaf that is flush with its wall is closed
MAX_HINGE_DISTANCE_M = 0.15  # largest distance of a hinge from the plane of its wall


def closed_yaw_of(leaf: Floats, walls: Walls, earlier: float | None) -> float | None:
    """Heading (rad) of the closed leaf, given the leaf's pose (3,) in the same frame; `earlier` if there is no wall.

    It is the direction of the wall through the hinge that is nearer to the `earlier` heading. Without one it is the direction
    nearer to the leaf: a door is then taken to be open by at most 90 degrees.
    """
    if not len(walls):
        return earlier
    distance = np.abs(walls.signed_distances(leaf[None, :2])[0])
    nearest = int(np.argmin(distance))
    if not distance[nearest] < MAX_HINGE_DISTANCE_M:
        return earlier
    direction = float(walls.directions[nearest])
    reference = float(leaf[2])
    if earlier is not None and abs(np.cos(direction - reference)) < MIN_FLUSH_COS:
        reference = earlier
    return direction if np.cos(direction - reference) >= 0.0 else float(se2.wrap_angle(direction + np.pi))
