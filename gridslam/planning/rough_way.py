"""Poses along a taut string, as stepping stones for the search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SPACING_M = 0.4


def spine_of(corners: Floats) -> Floats:
    """Poses `(n, 3)` along the lines between corners `(m, 2)`, at most 0.4 m apart.

    Within a line the yaw is the line's, at a corner half way between its two lines'. The first and the last pose have
    the yaw of the first and the last line. Equal corners are joined.
    """
    kept = np.concatenate([[True], np.hypot(*np.diff(corners, axis=0).T) > 1e-6])
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
