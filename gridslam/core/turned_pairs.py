"""The angle between neighbouring beams of a lidar (its step), found from turns of the robot.

When the robot turns on the spot, the readings move along the scan: by the angle of the turn, which the odometry measures, divided
by the step. With the right step, the readings before and after the turn agree once they are shifted back.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Pose = tuple[float, float, float]
Readings = NDArray[np.float32]

# Rotation between the scans of a pair: several beams, but most of the view is in both
MIN_ROTATION_RAD, MAX_ROTATION_RAD = 0.1, 0.5
MAX_MOVE_M = 0.1  # largest movement between the scans of a pair; readings change by at most as much
MIN_PAIRS, MAX_PAIRS = 20, 300
MIN_COMMON_BEAMS = 20
NEAR_M = 20.0  # larger readings are ignored: they may be codes for no return
FLOOR_M = 0.02  # noise of a reading, added to differences
# Largest cost of another step, relative to that of the assumed one. On public logs, right steps have 0.55 to 0.75 and wrong ones
# at least 0.93.
MAX_COST_RATIO = 0.8


class TurnedPairs:
    """Pairs of scans of a lidar between which the robot has turned, but hardly moved."""

    def __init__(self) -> None:
        self._first: tuple[Pose, Readings] | None = None
        self._pairs: list[tuple[float, Readings, Readings]] = []

    def add(self, pose: Pose, ranges: Readings) -> None:
        """Add the next scan, with the robot's pose (m, rad) by odometry."""
        if len(self._pairs) >= MAX_PAIRS:
            return
        if self._first is None:
            self._first = pose, ranges
            return
        (x, y, yaw), first = self._first
        rotation_rad = math.remainder(pose[2] - yaw, 2.0 * math.pi)
        has_moved = math.hypot(pose[0] - x, pose[1] - y) > MAX_MOVE_M
        if abs(rotation_rad) < MIN_ROTATION_RAD and not has_moved:
            return
        if not has_moved and abs(rotation_rad) <= MAX_ROTATION_RAD and len(first) == len(ranges):
            self._pairs.append((rotation_rad, first, ranges))
        self._first = pose, ranges

    def better_step(
        self,
        beams: int,
        assumed_rad: float,
        others_rad: Iterable[float],
        max_cost_ratio: float = MAX_COST_RATIO,
    ) -> float | None:
        """The other step (rad) with which scans of `beams` beams agree clearly better than with the assumed one; None: none."""
        pairs = [pair for pair in self._pairs if len(pair[1]) == beams]
        if len(pairs) < MIN_PAIRS:
            return None
        assumed = _cost(pairs, assumed_rad)
        costs = {step: _cost(pairs, step) for step in others_rad}
        best = min(costs, key=lambda step: costs[step], default=assumed_rad)
        return best if costs.get(best, math.inf) < max_cost_ratio * assumed else None


def _cost(pairs: Iterable[tuple[float, Readings, Readings]], step_rad: float) -> float:
    """Mean over pairs of the median difference (m) between readings at one bearing; infinite if too few pairs overlap."""
    costs = []
    for rotation_rad, first, second in pairs:
        shift = round(rotation_rad / step_rad)
        before, after = first[max(shift, 0) :], second[max(-shift, 0) :]
        common = min(len(before), len(after))
        before, after = before[:common], after[:common]
        near = (before < NEAR_M) & (after < NEAR_M)
        if np.count_nonzero(near) >= MIN_COMMON_BEAMS:
            costs.append(float(np.median(np.abs(before[near] - after[near]))) + FLOOR_M)
    return float(np.mean(costs)) if len(costs) >= MIN_PAIRS else math.inf
