"""Shortcuts between the poses of a path: the fastest chain of Dubins paths over all of them, by dynamic programming."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import CollisionWorld, advance
from gridslam.kernels.planning.drive_limits import CURVATURE, LENGTH, YAW, DriveLimits, X, Y, speed_on
from gridslam.kernels.planning.dubins import connect

JOINT_COST_S = 0.05  # added per piece: a path of few pieces is easier to improve later
DISTANCE = 5  # column of the joints, after those of a part: path length up to the joint


@compiled
def shortcut(
    world: CollisionWorld,
    start: NDArray[np.float64],
    parts: NDArray[np.float64],
    radii: NDArray[np.float64],
    limits: DriveLimits,
    spacing: float,
    max_joints_ahead: int,
) -> NDArray[np.float64]:
    """Motions `(m, 2)` (length, curvature) that take less time than the given motions `(n, 2)` between the same poses.

    `parts` are the given motions from the pose `start` (3,); those returned keep to the robot's `limits`. The path is cut into
    pieces of at most `spacing` (m). From every joint, each of the next `max_joints_ahead` joints is connected by Dubins paths
    of the given `radii` (m) where these are free.
    """
    joints = _joints(start, parts, spacing)
    n = joints.shape[0]
    time = np.full(n, np.inf)
    predecessor = np.zeros(n, np.int64)
    piece = np.zeros((n, 3, 2))
    time[0] = 0.0
    connection = np.zeros((3, 2))
    for j in range(1, n):
        for i in range(max(j - max_joints_ahead, 0), j):
            if i == j - 1:
                connection[:] = 0.0
                connection[0, 0], connection[0, 1] = joints[j, LENGTH], joints[j, CURVATURE]
                new = time[i] + connection[0, 0] / speed_on(connection[0, 1], limits) + JOINT_COST_S
                if new < time[j]:
                    time[j], predecessor[j], piece[j] = new, i, connection
                continue
            max_length = joints[j, DISTANCE] - joints[i, DISTANCE] + 1e-6
            if (
                time[i]
                + np.hypot(joints[j, X] - joints[i, X], joints[j, Y] - joints[i, Y]) / limits.top_speed
                > time[j]
            ):
                continue
            for radius in radii:
                found = connect(
                    world,
                    joints[i, :3],
                    joints[j, :3],
                    radius=radius,
                    max_length=max_length,
                    out=connection,
                )
                if not np.isfinite(found):
                    continue
                new = time[i] + JOINT_COST_S
                for k in range(3):
                    new += connection[k, 0] / speed_on(connection[k, 1], limits)
                if new < time[j]:
                    time[j], predecessor[j], piece[j] = new, i, connection
    path: NDArray[np.float64] = _collect(predecessor, piece)
    return path


@compiled
def _joints(start: NDArray[np.float64], parts: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Joints `(n, 6)`: pose, length and curvature of the piece that ends there, path length up to there."""
    n = 1
    for k in range(parts.shape[0]):
        n += max(int(np.ceil(parts[k, 0] / spacing)), 1)
    joints = np.zeros((n, 6))
    joints[0, :3] = start
    at = 1
    for k in range(parts.shape[0]):
        count = max(int(np.ceil(parts[k, 0] / spacing)), 1)
        x, y, yaw = joints[at - 1, X], joints[at - 1, Y], joints[at - 1, YAW]
        distance = joints[at - 1, DISTANCE]
        for i in range(1, count + 1):
            length = parts[k, 0] * i / count
            joints[at, X], joints[at, Y], joints[at, YAW] = advance(x, y, yaw, length, parts[k, 1])
            joints[at, LENGTH], joints[at, CURVATURE], joints[at, DISTANCE] = (
                parts[k, 0] / count,
                parts[k, 1],
                distance + length,
            )
            at += 1
    return joints


@compiled
def _collect(predecessor: NDArray[np.int64], piece: NDArray[np.float64]) -> NDArray[np.float64]:
    """The pieces from the first joint to the last, equal neighbours merged."""
    chain = [predecessor.shape[0] - 1]
    while chain[-1] > 0:
        chain.append(predecessor[chain[-1]])
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
