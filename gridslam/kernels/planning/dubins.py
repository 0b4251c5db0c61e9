"""Dubins paths from pose to pose: arc-line-arc and arc-arc-arc of one radius, driven forwards.

Source: Dubins 1957; closed forms as in Shkel and Lumelsky 2001.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import CollisionWorld, advance, is_free

WORDS = np.array([[1, 0, 1], [-1, 0, -1], [1, 0, -1], [-1, 0, 1], [-1, 1, -1], [1, -1, 1]], np.int64)
_FULL_CIRCLE = 2.0 * np.pi
_FULL_CIRCLE_TOLERANCE = 1e-9  # rad; an angle this close to a full turn counts as 0


@compiled
def _wrapped(angle: float) -> float:
    """The angle (rad) in [0, 2 pi)."""
    wrapped = angle % _FULL_CIRCLE
    return 0.0 if wrapped > _FULL_CIRCLE - _FULL_CIRCLE_TOLERANCE else wrapped


@compiled
def _word(word: int, d: float, a: float, b: float) -> tuple[float, float, float]:
    """The three parts of a word in units of the radius (angles for arcs); the first is negative if the word does not exist."""
    sa, sb, ca, cb = np.sin(a), np.sin(b), np.cos(a), np.cos(b)
    cab = np.cos(a - b)
    if word == 0:  # LSL
        p2 = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sa - sb)
        t = np.arctan2(cb - ca, d + sa - sb)
        return _wrapped(t - a), np.sqrt(max(p2, 0.0)), _wrapped(b - t)
    if word == 1:  # RSR
        p2 = 2.0 + d * d - 2.0 * cab + 2.0 * d * (sb - sa)
        t = np.arctan2(ca - cb, d - sa + sb)
        return _wrapped(a - t), np.sqrt(max(p2, 0.0)), _wrapped(t - b)
    if word == 2:  # LSR
        p2 = -2.0 + d * d + 2.0 * cab + 2.0 * d * (sa + sb)
        if p2 < 0.0:
            return -1.0, 0.0, 0.0
        p = np.sqrt(p2)
        t = np.arctan2(-ca - cb, d + sa + sb) - np.arctan2(-2.0, p)
        return _wrapped(t - a), p, _wrapped(t - b)
    if word == 3:  # RSL
        p2 = -2.0 + d * d + 2.0 * cab - 2.0 * d * (sa + sb)
        if p2 < 0.0:
            return -1.0, 0.0, 0.0
        p = np.sqrt(p2)
        t = np.arctan2(ca + cb, d - sa - sb) - np.arctan2(2.0, p)
        return _wrapped(a - t), p, _wrapped(b - t)
    if word == 4:  # RLR
        k = (6.0 - d * d + 2.0 * cab + 2.0 * d * (sa - sb)) / 8.0
        if abs(k) > 1.0:
            return -1.0, 0.0, 0.0
        p = _FULL_CIRCLE - np.arccos(k)
        t = _wrapped(a - np.arctan2(ca - cb, d - sa + sb) + 0.5 * p)
        return t, p, _wrapped(a - b - t + p)
    k = (6.0 - d * d + 2.0 * cab + 2.0 * d * (sb - sa)) / 8.0  # LRL
    if abs(k) > 1.0:
        return -1.0, 0.0, 0.0
    p = _FULL_CIRCLE - np.arccos(k)
    t = _wrapped(-a + np.arctan2(cb - ca, d + sa - sb) + 0.5 * p)
    return t, p, _wrapped(b - a - t + p)


@compiled
def dubins_words(
    start: NDArray[np.float64], goal: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lengths `(6, 3)` (m) of the parts of the six words, and their sums `(6,)`, infinite if a word does not exist."""
    dx, dy = goal[0] - start[0], goal[1] - start[1]
    direction = np.arctan2(dy, dx)
    d = np.hypot(dx, dy) / radius
    parts = np.zeros((6, 3))
    total = np.full(6, np.inf)
    for word in range(6):
        t, p, q = _word(word, d, start[2] - direction, goal[2] - direction)
        if t >= 0.0:
            parts[word, 0], parts[word, 1], parts[word, 2] = t * radius, p * radius, q * radius
            total[word] = (t + p + q) * radius
    return parts, total


@compiled
def connect(
    world: CollisionWorld,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    radius: float,
    max_length: float,
    out: NDArray[np.float64],
) -> float:
    """Length (m) of the shortest collision-free word of at most `max_length` (m); infinite if there is none.

    It leads from the pose `start` to `goal` (3,) in the frame of `world` by arcs of `radius` (m). The length (m) and curvature
    (1/m, left positive) of its parts are written to `out` `(3, 2)`.
    """
    parts, total = dubins_words(start, goal, radius)
    for _ in range(6):
        word = int(np.argmin(total))
        if not total[word] <= max_length:
            return np.inf
        x, y, yaw = start[0], start[1], start[2]
        free = True
        for k in range(3):
            length, curvature = parts[word, k], WORDS[word, k] / radius
            if length > 0.0:
                free = is_free(world, x, y, yaw=yaw, length=length, curvature=curvature)
                if not free:
                    break
                x, y, yaw = advance(x, y, yaw, length, curvature)
            out[k, 0], out[k, 1] = length, curvature
        if free:
            return float(total[word])
        total[word] = np.inf
    return np.inf
