"""The Dynamic Window Approach's inner loop: how far the robot can drive at each pair of wheel speeds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

STANDING_MPS = 1e-9
MIN_CURVATURE = 1e-6  # 1/m; flatter arcs count as lines


@compiled
def free_distances(
    speeds: NDArray[np.float64],
    obstacles: NDArray[np.float64],
    base: float,
    radius: float,
    max_distance: float,
) -> NDArray[np.float64]:
    """Distance (m) `(n,)` that a disc can drive along the arc of wheel speeds `(n, 2)` (m/s, left and right) before a collision.

    The disc of radius `radius` (m) starts at the origin and x points forward; `obstacles` are points `(m, 2)`; `base` (m) is the
    wheel base. Distances end at `max_distance`. A disc that turns on the spot collides with nothing. A point inside the disc
    stops it only when the disc drives towards the point.
    """
    distances = np.empty(speeds.shape[0])
    for i in range(speeds.shape[0]):
        forward = 0.5 * (speeds[i, 0] + speeds[i, 1])
        yaw_rate = (speeds[i, 1] - speeds[i, 0]) / base
        distances[i] = max_distance
        if abs(forward) < STANDING_MPS:
            continue
        sign = 1.0 if forward > 0.0 else -1.0
        curvature = yaw_rate / forward
        for k in range(obstacles.shape[0]):
            x, y = obstacles[k, 0], obstacles[k, 1]
            if x * x + y * y > (distances[i] + radius) ** 2:
                continue
            distance = _line_distance(sign * x, y, radius)
            if abs(curvature) > MIN_CURVATURE:
                # mirrored so that the robot drives forward and turns left
                distance = _arc_distance(sign * x, y if curvature > 0.0 else -y, 1.0 / abs(curvature), radius)
            if distance < distances[i]:
                distances[i] = distance
    return distances


@compiled
def _line_distance(x: float, y: float, radius: float) -> float:
    """Distance along +x until the disc about the origin touches (x, y)."""
    if x <= 0.0 or abs(y) >= radius:
        return np.inf
    return float(max(x - np.sqrt(radius * radius - y * y), 0.0))


@compiled
def _arc_distance(x: float, y: float, arc: float, radius: float) -> float:
    """Distance along a left arc of radius `arc` until the disc about the origin touches (x, y)."""
    if x * x + y * y < radius * radius:
        return 0.0 if x > 0.0 else np.inf
    to_centre = np.hypot(x, y - arc)  # from the point to the centre of the arc
    if to_centre >= arc + radius or to_centre <= arc - radius or to_centre < 1e-9:
        return np.inf
    # the angle at the arc's centre between the point and the touching disc
    cosine = (arc * arc + to_centre * to_centre - radius * radius) / (2.0 * arc * to_centre)
    half = np.arccos(min(max(cosine, -1.0), 1.0))
    angle = np.arctan2(x, arc - y)  # from the robot to the point, in the driving direction
    first = (angle - half) % (2.0 * np.pi)
    return float(arc * first)
