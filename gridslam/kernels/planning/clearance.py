"""Is the robot clear of all obstacles, at a pose and all along an arc or a line?

Obstacles are the squares of the blocked cells. `field` holds the exact distance (m) to the nearest of them at every lattice
point: corners, middles of edges and centres of cells, half a cell apart; point (i, j) lies at y = i, x = j half cells. A
distance changes by no more than the way travelled, so the field bounds it everywhere; only where the bound does not decide
are the squares themselves looked at. The robot is a set of discs `(n, 3)`: x, y (m, robot frame) and radius (m).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

STRAIGHT = 1e-9  # curvatures (1/m) below this are lines


class World(NamedTuple):
    """The map and the robot, as the planning kernels take them: lengths in metres, `margin` is kept off obstacles."""

    field: NDArray[np.float32]
    blocked: NDArray[np.bool_]
    resolution: float
    discs: NDArray[np.float64]
    margin: float


@compiled
def wall_distance(world: World, x: float, y: float, needed: float) -> float:
    """A lower bound (m) of the distance from a point to the nearest blocked square: >= `needed` where that is so."""
    half = 0.5 * world.resolution
    i, j = int(np.rint(y / half)), int(np.rint(x / half))
    if i < 0 or j < 0 or i >= world.field.shape[0] or j >= world.field.shape[1]:
        return -1.0
    off = np.hypot(x - j * half, y - i * half)
    bound = float(world.field[i, j] - off)
    if bound >= needed or world.field[i, j] + off < needed:
        return bound
    return float(_distance_to_squares(world, x, y, needed + world.resolution))


@compiled
def _distance_to_squares(world: World, x: float, y: float, reach: float) -> float:
    """Distance to the nearest blocked square; `reach` when there is none nearer."""
    rows, cols = world.blocked.shape
    side = world.resolution
    nearest = reach * reach
    for row in range(max(int((y - reach) / side), 0), min(int((y + reach) / side) + 1, rows)):
        dy = max(row * side - y, y - (row + 1) * side, 0.0)
        for col in range(max(int((x - reach) / side), 0), min(int((x + reach) / side) + 1, cols)):
            if world.blocked[row, col]:
                dx = max(col * side - x, x - (col + 1) * side, 0.0)
                nearest = min(nearest, dx * dx + dy * dy)
    return float(np.sqrt(nearest))


@compiled
def advance(x: float, y: float, yaw: float, length: float, curvature: float) -> tuple[float, float, float]:
    """The pose after driving `length` (m, negative: backwards) along an arc of the given curvature (1/m, left positive)."""
    if abs(curvature) < STRAIGHT:
        return x + length * np.cos(yaw), y + length * np.sin(yaw), yaw
    turned = yaw + length * curvature
    return (
        x + (np.sin(turned) - np.sin(yaw)) / curvature,
        y - (np.cos(turned) - np.cos(yaw)) / curvature,
        turned,
    )


@compiled
def pose_clearance(
    world: World,
    x: float,
    y: float,
    yaw: float,
    curvature: float,
    spin: float,
) -> float:
    """How far (m) the robot may drive without any disc coming nearer to an obstacle than 0; negative unless all are `margin` off.

    Driving along `curvature` a disc's centre moves the faster the farther it lies off the turning centre; `spin` = 1 asks for
    the angle (rad) of a turn on the spot instead.
    """
    c, s = np.cos(yaw), np.sin(yaw)
    way = 1e9
    for k in range(world.discs.shape[0]):
        ox, oy, radius = world.discs[k, 0], world.discs[k, 1], world.discs[k, 2]
        px, py = x + c * ox - s * oy, y + s * ox + c * oy
        free = wall_distance(world, px, py, radius + world.margin) - radius
        if free < world.margin:
            return -1.0
        speed = np.hypot(ox, oy) if spin > 0.0 else np.hypot(1.0 - curvature * oy, curvature * ox)
        way = min(way, (free + 0.9 * world.margin) / max(speed, 1e-6))
    return way


@compiled
def is_free(
    world: World,
    x: float,
    y: float,
    yaw: float,
    length: float,
    curvature: float,
) -> bool:
    """Whether the robot touches nothing all along an arc or a line (length negative: backwards).

    At every place looked at, the clearance c is at least the margin m; the next is c + 0.9 m on. In between the clearance is
    at least half of (c + m - step), which is positive: nothing is missed.
    """
    at, total = 0.0, abs(length)
    sign = 1.0 if length >= 0.0 else -1.0
    while True:
        px, py, pyaw = advance(x, y, yaw, sign * at, curvature)
        way = pose_clearance(world, px, py, pyaw, curvature, 0.0)
        if way < 0.0:
            return False
        if at >= total:
            return True
        at = min(at + way, total)


@compiled
def is_free_to_turn(
    world: World,
    x: float,
    y: float,
    yaw: float,
    angle: float,
) -> bool:
    """Whether the robot touches nothing while it turns on the spot by `angle` (rad)."""
    at, total = 0.0, abs(angle)
    sign = 1.0 if angle >= 0.0 else -1.0
    while True:
        way = pose_clearance(world, x, y, yaw + sign * at, 0.0, 1.0)
        if way < 0.0:
            return False
        if at >= total:
            return True
        at = min(at + way, total)
