"""Shorter ways between the poses of a path: the best chain of Dubins paths over all of them (dynamic programming)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import World, advance
from gridslam.kernels.planning.dubins import connect
from gridslam.kernels.planning.search import speed_on

JOINT_S = 0.05  # the price of a further piece: fewer pieces are easier to widen later


@compiled
def shortcut(
    world: World,
    start: NDArray[np.float64],
    parts: NDArray[np.float64],
    radii: NDArray[np.float64],
    limits: NDArray[np.float64],
    spacing: float,
    reach: int,
) -> NDArray[np.float64]:
    """Parts `(m, 2)` of length and curvature that take less time than the given ones `(n, 2)` between the same poses.

    The path is cut into pieces of at most `spacing` (m); from every joint each of the next `reach` joints may be
    reached by a Dubins path of one of the `radii` (m).
    """
    joints = _joints(start, parts, spacing)
    n = joints.shape[0]
    time = np.full(n, np.inf)
    before = np.zeros(n, np.int64)
    piece = np.zeros((n, 3, 2))
    time[0] = 0.0
    shot = np.zeros((3, 2))
    for j in range(1, n):
        for i in range(max(j - reach, 0), j):
            if i == j - 1:
                shot[:] = 0.0
                shot[0, 0], shot[0, 1] = joints[j, 3], joints[j, 4]
                new = time[i] + shot[0, 0] / speed_on(shot[0, 1], limits[0], limits[1], limits[2]) + JOINT_S
                if new < time[j]:
                    time[j], before[j], piece[j] = new, i, shot
                continue
            longest = joints[j, 5] - joints[i, 5] + 1e-6
            if (
                time[i] + np.hypot(joints[j, 0] - joints[i, 0], joints[j, 1] - joints[i, 1]) / limits[0]
                > time[j]
            ):
                continue
            for radius in radii:
                found = connect(
                    world,
                    joints[i, :3],
                    joints[j, :3],
                    radius,
                    longest,
                    shot,
                )
                if not np.isfinite(found):
                    continue
                new = time[i] + JOINT_S
                for k in range(3):
                    new += shot[k, 0] / speed_on(shot[k, 1], limits[0], limits[1], limits[2])
                if new < time[j]:
                    time[j], before[j], piece[j] = new, i, shot
    path: NDArray[np.float64] = _collect(before, piece)
    return path


@compiled
def _joints(start: NDArray[np.float64], parts: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Joints `(n, 6)`: x, y, yaw, length and curvature of the piece that ends here, length of the way so far."""
    n = 1
    for k in range(parts.shape[0]):
        n += max(int(np.ceil(parts[k, 0] / spacing)), 1)
    joints = np.zeros((n, 6))
    joints[0, :3] = start
    at = 1
    for k in range(parts.shape[0]):
        count = max(int(np.ceil(parts[k, 0] / spacing)), 1)
        x, y, yaw = joints[at - 1, 0], joints[at - 1, 1], joints[at - 1, 2]
        way = joints[at - 1, 5]
        for i in range(1, count + 1):
            length = parts[k, 0] * i / count
            joints[at, 0], joints[at, 1], joints[at, 2] = advance(x, y, yaw, length, parts[k, 1])
            joints[at, 3], joints[at, 4], joints[at, 5] = parts[k, 0] / count, parts[k, 1], way + length
            at += 1
    return joints


@compiled
def _collect(before: NDArray[np.int64], piece: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pieces from the first joint to the last, equal neighbours joined."""
    chain = [before.shape[0] - 1]
    while chain[-1] > 0:
        chain.append(before[chain[-1]])
    out = np.empty((3 * len(chain), 2))
    n = 0
    for index in range(len(chain) - 2, -1, -1):
        for k in range(3):
            length, curvature = piece[chain[index], k]
            if length == 0.0:
                continue
            if n > 0 and out[n - 1, 1] == curvature:
                out[n - 1, 0] += length
            else:
                out[n, 0], out[n, 1] = length, curvature
                n += 1
    return out[:n].copy()
