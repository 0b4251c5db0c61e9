"""Reference implementation of `gridslam.kernels.segments`: every ray is tested against every shape."""

from __future__ import annotations

import math

import numpy as np


def cast_one(segments: np.ndarray, circles: np.ndarray, ray: np.ndarray, max_range: float) -> float:
    """Distance to the nearest segment or circle, at most `max_range`."""
    ox, oy, dx, dy = ray.tolist()
    nearest = max_range
    for x0, y0, x1, y1 in segments.tolist():
        # o + t d = a + u (b - a)
        matrix = np.array([[dx, x0 - x1], [dy, y0 - y1]])
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        t, u = np.linalg.solve(matrix, [x0 - ox, y0 - oy])
        if t >= 0.0 and 0.0 <= u <= 1.0:
            nearest = min(nearest, float(t))
    for x, y, radius in circles.tolist():
        # |o + t d - c| = r
        b = dx * (ox - x) + dy * (oy - y)
        c = (ox - x) ** 2 + (oy - y) ** 2 - radius**2
        if b * b >= c:
            roots = (-b - math.sqrt(b * b - c), -b + math.sqrt(b * b - c))
            nearest = min([nearest, *(root for root in roots if root >= 0.0)])
    return nearest
