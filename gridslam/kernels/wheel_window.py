"""The Dynamic Window Approach's inner loop: how far each pair of wheel speeds may be driven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

STRAIGHT = 1e-6  # rad/m; arcs flatter than this are lines


@compiled
def free_ways(
    speeds: NDArray[np.float64], obstacles: NDArray[np.float64], base: float, radius: float, most: float
) -> NDArray[np.float64]:
    """Way (m) `(n,)` that a disc may go along the arc of wheel speeds `(n, 2)` (m/s, left and right) before it touches a point.

    The disc's centre is the origin, x ahead; obstacles are points `(m, 2)`. At most `most`. What turns on the spot touches
    nothing. A point that the disc touches already stops it only when it drives towards the point.
    """
    ways = np.empty(speeds.shape[0])
    for i in range(speeds.shape[0]):
        forward = 0.5 * (speeds[i, 0] + speeds[i, 1])
        turn = (speeds[i, 1] - speeds[i, 0]) / base
        ways[i] = most
        if abs(forward) < 1e-9:
            continue
        sign = 1.0 if forward > 0.0 else -1.0
        curvature = turn / forward
        for k in range(obstacles.shape[0]):
            x, y = obstacles[k, 0], obstacles[k, 1]
            if x * x + y * y > (ways[i] + radius) ** 2:
                continue
            way = _line_way(sign * x, y, radius)
            if abs(curvature) > STRAIGHT:
                # mirrored so that the robot drives ahead and turns left
                way = _arc_way(sign * x, y if curvature > 0.0 else -y, 1.0 / abs(curvature), radius)
            if way < ways[i]:
                ways[i] = way
    return ways


@compiled
def _line_way(x: float, y: float, radius: float) -> float:
    """Way along +x until the disc about the origin touches (x, y)."""
    if x <= 0.0 or abs(y) >= radius:
        return np.inf
    return float(max(x - np.sqrt(radius * radius - y * y), 0.0))


@compiled
def _arc_way(x: float, y: float, arc: float, radius: float) -> float:
    """Way along a left arc of radius `arc` until the disc about the origin touches (x, y)."""
    if x * x + y * y < radius * radius:
        return 0.0 if x > 0.0 else np.inf
    away = np.hypot(x, y - arc)  # from the centre of the turn
    if away >= arc + radius or away <= arc - radius or away < 1e-9:
        return np.inf
    # the angle at the turn's centre between the point and the touching disc
    cosine = (arc * arc + away * away - radius * radius) / (2.0 * arc * away)
    half = np.arccos(min(max(cosine, -1.0), 1.0))
    angle = np.arctan2(x, arc - y)  # from where the robot is, in the direction of the turn
    first = (angle - half) % (2.0 * np.pi)
    return float(arc * first)
