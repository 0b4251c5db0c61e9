"""Poses along a polyline, which guide the search for motions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SPACING_M = 0.4  # largest distance between consecutive poses
SAME_CORNER_M = 1e-6  # consecutive corners closer than this are merged


def poses_along_polyline(corners: Floats) -> Floats:
    """Poses `(n, 3)` along the lines between corners `(m, 2)` (m), at most SPACING_M apart.

    On a line the yaw is that of the line; at a corner it is half-way between the yaws of the two lines. The first and the last
    pose have the yaw of the first and the last line. Repeated corners are merged.
    """
    kept = np.concatenate([[True], np.hypot(*np.diff(corners, axis=0).T) > SAME_CORNER_M])
    points = corners[kept]
    if len(points) < 2:
        return np.array([[*points[0], 0.0]])
    legs = np.diff(points, axis=0)
    lengths = np.hypot(*legs.T)
    yaws = np.unwrap(np.arctan2(legs[:, 1], legs[:, 0]))
    poses = [np.array([*points[0], yaws[0]])]
    for i, (leg, length, yaw) in enumerate(zip(legs, lengths, yaws, strict=True)):
        count = int(np.ceil(length / SPACING_M))
        poses += [np.array([*(points[i] + leg * k / count), yaw]) for k in range(1, count)]
        after = yaws[i + 1] if i + 1 < len(yaws) else yaw
        poses.append(np.array([*points[i + 1], 0.5 * (yaw + after)]))
    return np.array(poses)
