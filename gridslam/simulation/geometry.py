"""Shapes of a world as segments `(n, 4)` of x0, y0, x1, y1 in metres, and circles `(n, 3)` of x, y, radius."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.simulation.shapes import Box, Door, MovableObject, PoseDeg, Wall

Array = NDArray[np.float64]
NO_SEGMENTS: Array = np.zeros((0, 4))


def radians(pose: PoseDeg) -> Array:
    """A pose of a world file, whose yaw is in degrees, as `(3,)`: x, y (m), yaw (rad)."""
    return np.array([pose[0], pose[1], float(se2.wrap_angle(math.radians(pose[2])))])


def polyline(points: Sequence[tuple[float, float]] | Array, closed: bool = False) -> Array:
    """The segments `(m, 4)` between consecutive points `(n, 2)`; `closed` adds the one from the last to the first."""
    corners = np.asarray(points, dtype=np.float64)
    if closed:
        corners = np.concatenate([corners, corners[:1]])
    return np.concatenate([corners[:-1], corners[1:]], axis=1)


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Array:
    """The four sides `(4, 4)` of a rectangle, counter-clockwise."""
    return polyline([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], closed=True)


def wall(shape: Wall) -> Array:
    """The segments `(m, 4)` of a wall."""
    return rectangle(*shape.rectangle) if shape.rectangle else polyline(shape.points, shape.closed)


def placed_rectangle(T_map_own: Array, x0: float, y0: float, x1: float, y1: float) -> Array:
    """The sides `(4, 4)` in the map frame of a rectangle given in its own frame."""
    corners = se2.transform_points(T_map_own, np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]))
    return polyline(corners, closed=True)


def box(shape: Box) -> Array:
    """The sides `(4, 4)` of a box's footprint."""
    return centred(radians((*shape.centre, shape.yaw_deg)), shape.size)


def centred(T_map_own: Array, size: tuple[float, float]) -> Array:
    """The sides `(4, 4)` of a rectangle centred on a pose `(3,)`."""
    x, y = 0.5 * size[0], 0.5 * size[1]
    return placed_rectangle(T_map_own, -x, -y, x, y)


def door_pose(door: Door, opening_deg: float) -> Array:
    """T_map_leaf `(3,)`: origin at the hinge, x along the leaf."""
    return radians((*door.hinge, door.closed_deg + opening_deg))


def leaf(door: Door, opening_deg: float) -> Array:
    """The sides `(4, 4)` of the footprint of a door's leaf."""
    half = 0.5 * door.thickness_m
    return placed_rectangle(door_pose(door, opening_deg), 0.0, -half, door.width_m, half)


def movable(obj: MovableObject, pose: PoseDeg) -> Array:
    """The sides `(4, 4)` of the footprint of a movable object at a pose."""
    return centred(radians(pose), obj.size)
