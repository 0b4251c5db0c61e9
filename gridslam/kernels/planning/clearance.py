"""Collision checks of a robot at a pose and along arcs, lines and turns on the spot.

Obstacles are the squares of the blocked cells. `field` holds the exact distance (m) to the nearest square at every lattice
point: corners, edge midpoints and centres of cells, half a cell apart; point (i, j) lies at y = i, x = j half cells. A distance
changes by at most the distance travelled, so the field bounds it everywhere; the squares themselves are only searched where the
bound does not decide. The robot is a set of discs `(n, 3)`: x, y (m, robot frame) and radius (m).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.drive_limits import STRAIGHT_CURVATURE

PROGRESS = 0.9  # of the margin: the part of it that a step may use up
MIN_SPEED = 1e-6  # of a disc about the turning centre, against division by zero
OUTSIDE = -1.0  # clearance off the map, or of a robot that touches something


class CollisionWorld(NamedTuple):
    """Map and robot as the planning kernels take them. Lengths are metres; the discs keep `margin` off obstacles."""

    field: NDArray[np.float32]
    blocked: NDArray[np.bool_]
    resolution: float
    discs: NDArray[np.float64]
    margin: float


@compiled
def wall_distance(world: CollisionWorld, x: float, y: float, required: float) -> float:
    """A lower bound (m) of the distance from (x, y) to the nearest blocked square, at least `required` if the distance is."""
    half = 0.5 * world.resolution
    i, j = int(np.rint(y / half)), int(np.rint(x / half))
    if i < 0 or j < 0 or i >= world.field.shape[0] or j >= world.field.shape[1]:
        return OUTSIDE
    off = np.hypot(x - j * half, y - i * half)
    bound = float(world.field[i, j] - off)
    if bound >= required or world.field[i, j] + off < required:
        return bound
    return float(_distance_to_squares(world, x, y, required + world.resolution))


@compiled
def _distance_to_squares(world: CollisionWorld, x: float, y: float, max_distance: float) -> float:
    """Distance (m) from (x, y) to the nearest blocked square, at most `max_distance`."""
    rows, cols = world.blocked.shape
    side = world.resolution
    nearest = max_distance * max_distance
    for row in range(max(int((y - max_distance) / side), 0), min(int((y + max_distance) / side) + 1, rows)):
        dy = max(row * side - y, y - (row + 1) * side, 0.0)
        for col in range(
            max(int((x - max_distance) / side), 0), min(int((x + max_distance) / side) + 1, cols)
        ):
            if world.blocked[row, col]:
                dx = max(col * side - x, x - (col + 1) * side, 0.0)
                nearest = min(nearest, dx * dx + dy * dy)
    return float(np.sqrt(nearest))


@compiled
def advance(x: float, y: float, yaw: float, length: float, curvature: float) -> tuple[float, float, float]:
    """The pose after driving `length` (m, negative: backwards) along an arc of the given curvature (1/m, left positive)."""
    if abs(curvature) < STRAIGHT_CURVATURE:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    turned = yaw + length * curvature
    return (
        x + (np.sin(turned) - np.sin(yaw)) / curvature,
        y - (np.cos(turned) - np.cos(yaw)) / curvature,
        turned,
    )


@compiled
def pose_clearance(
    world: CollisionWorld,
    x: float,
    y: float,
    yaw: float,
    forward: float,
    rotation: float,
) -> float:
    """Motion of the robot from a pose before a disc can touch an obstacle; OUTSIDE if one is within the margin.

    The pose in the frame of `world` is `x`, `y` (m), `yaw` (rad). The motion is a multiple of `forward` (m) and `rotation`
    (rad), and the result is that multiple: metres for 1 and a curvature, radians for 0 and 1. A disc moves faster the farther
    its centre lies from the turning centre.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    free_distance = 1e9
    for k in range(world.discs.shape[0]):
        ox, oy, radius = world.discs[k, 0], world.discs[k, 1], world.discs[k, 2]
        px, py = x + c * ox - s * oy, y + s * ox + c * oy
        free = wall_distance(world, px, py, radius + world.margin) - radius
        if free < world.margin:
            return OUTSIDE
        speed = np.hypot(forward - rotation * oy, rotation * ox)
        free_distance = min(free_distance, (free + PROGRESS * world.margin) / max(speed, MIN_SPEED))
    return free_distance


@compiled
def is_free(
    world: CollisionWorld,
    x: float,
    y: float,
    yaw: float,
    length: float,
    curvature: float,
) -> bool:
    """Whether the robot stays clear of obstacles along an arc or a line of `length` (m, negative: backwards).

    At every pose checked the clearance c is at least the margin m, and the next pose is at most c + 0.9 m ahead. In between the
    clearance is at least half of (c + m - step), which is positive, so no collision is missed.
    """
    travelled, total = 0.0, abs(length)
    sign = 1.0 if length >= 0.0 else -1.0
    while True:
        px, py, pyaw = advance(x, y, yaw, sign * travelled, curvature)
        free_distance = pose_clearance(world, px, py, pyaw, forward=1.0, rotation=curvature)
        if free_distance < 0.0:
            return False
        if travelled >= total:
            return True
        travelled = min(travelled + free_distance, total)


@compiled
def is_free_to_turn_in_place(
    world: CollisionWorld,
    x: float,
    y: float,
    yaw: float,
    angle: float,
) -> bool:
    """Whether the robot stays clear of obstacles while it turns on the spot by `angle` (rad)."""
    travelled, total = 0.0, abs(angle)
    sign = 1.0 if angle >= 0.0 else -1.0
    while True:
        free_distance = pose_clearance(world, x, y, yaw + sign * travelled, forward=0.0, rotation=1.0)
        if free_distance < 0.0:
            return False
        if travelled >= total:
            return True
        travelled = min(travelled + free_distance, total)
