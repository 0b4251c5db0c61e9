"""Reference implementations of the kernels that turn costs into paths and improve paths and tours."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.clearance import CollisionWorld, advance
from gridslam.kernels.planning.drive_limits import DriveLimits, speed_on
from gridslam.kernels.planning.dubins import connect
from gridslam.kernels.planning.shortcut import JOINT_COST_S

Floats = NDArray[np.float64]
NEIGHBOURS = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0)]


def descend(cost: NDArray[np.float32], start: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells downhill from the start to a cell of cost 0, each the neighbour with the largest drop per distance."""
    cells = [start]
    while cost[cells[-1]] > 0.0:
        row, col = cells[-1]
        drops = {
            (row + dr, col + dc): float(cost[row, col] - cost[row + dr, col + dc]) / math.hypot(dr, dc)
            for dr, dc in NEIGHBOURS
            if 0 <= row + dr < cost.shape[0] and 0 <= col + dc < cost.shape[1]
        }
        best = max(drops, key=lambda cell: drops[cell])
        if not drops[best] > 0.0:
            return []
        cells.append(best)
    return cells


def joints_along(
    start: Floats, motions: Floats, spacing: float
) -> tuple[list[Floats], list[tuple[float, float]]]:
    """The poses between pieces of at most `spacing` (m) of forward motions, and the piece before each but the first."""
    poses, pieces = [start], []
    for length, curvature in motions.tolist():
        count = max(math.ceil(length / spacing), 1)
        first = poses[-1]
        for k in range(1, count + 1):
            poses.append(np.array(advance(*first, length * k / count, curvature)))
            pieces.append((length / count, curvature))
    return poses, pieces


def shortcut_time(
    world: CollisionWorld,
    start: Floats,
    motions: Floats,
    radii: Floats,
    limits: DriveLimits,
    spacing: float,
    max_joints_ahead: int,
) -> float:
    """Time (s), with JOINT_COST_S a piece, of the fastest chain of given pieces and Dubins paths between joints."""
    poses, pieces = joints_along(start, motions, spacing)
    along = np.concatenate([[0.0], np.cumsum([length for length, _ in pieces])])
    times = [0.0] + [math.inf] * (len(poses) - 1)
    parts = np.zeros((3, 2))
    for j in range(1, len(poses)):
        length, curvature = pieces[j - 1]
        times[j] = times[j - 1] + length / speed_on(curvature, limits) + JOINT_COST_S
        for i in range(max(j - max_joints_ahead, 0), j - 1):
            for radius in radii:
                longest = along[j] - along[i] + 1e-6
                if math.isfinite(connect(world, poses[i], poses[j], radius, longest, parts)):
                    driven = sum(part / speed_on(curvature, limits) for part, curvature in parts.tolist())
                    times[j] = min(times[j], times[i] + driven + JOINT_COST_S)
    return times[-1]


def improving_moves(distances: Floats, order: list[int]) -> int:
    """The number of reversals of a part and moves of up to three places that shorten an open tour with a fixed first place."""

    def length(tour: list[int]) -> float:
        return float(sum(distances[a, b] for a, b in itertools.pairwise(tour)))

    n, now = len(order), length(order)
    tours = [
        order[:i] + order[i : j + 1][::-1] + order[j + 1 :] for i in range(1, n) for j in range(i + 1, n)
    ]
    for size in (1, 2, 3):
        for i in range(1, n - size + 1):
            block, rest = order[i : i + size], order[:i] + order[i + size :]
            for k in range(1, len(rest) + 1):
                tours += [rest[:k] + piece + rest[k:] for piece in (block, block[::-1])]
    return sum(length(tour) < now - 1e-6 for tour in tours)
