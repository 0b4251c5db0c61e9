"""From any drivable path to one with less travel time between the same poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import wrap_angle
from gridslam.kernels.planning.circles import chain_parts, least_time
from gridslam.kernels.planning.shortcut import shortcut
from gridslam.planning.space import Space
from gridslam.planning.travel_time import NOTHING, SpeedLimits, parts_of, time_of

Floats = NDArray[np.float64]

WIDTHS = (1.0, 2.0, 4.0)  # radii that shortcuts try, in units of the smallest
SPACING_M = 0.5
REACH = 40
FIRST_STEP_M, LAST_STEP_M = 0.64, 0.005
PASSES = 2


@dataclass(frozen=True, slots=True)
class Refiner:
    """The robot in its space: the smallest radius (m) of its arcs, whether it turns on the spot, and its speeds.

    With `search_radius_m`, the smallest radius of the given motions, `radius_m` may be 0.
    """

    space: Space
    radius_m: float
    search_radius_m: float
    limits: SpeedLimits

    def refine(self, motions: Floats, begin: Floats, start: Floats, goal: Floats) -> Floats:
        """Parts `(m, 6)` from `start` to `goal` that take less time than the motions `(n, 2)` from `begin`.

        Lengths below 0 are driven backwards. Where the yaws of `begin` and `start`, or of the motions' end and the goal,
        differ, the robot turns on the spot; a goal yaw of NaN is free.
        """
        done = []
        runs = _runs(motions)
        for i, run in enumerate(runs):
            end = _end(begin, run)
            first = start if i == 0 else begin
            last = goal if i == len(runs) - 1 else end
            done.append(self._one_direction(run, begin, first, last))
            begin = end
        return np.vstack(done)

    def polyline(self, points: Floats, start: Floats, goal: Floats) -> Floats:
        """Parts `(m, 6)` along lines between `points` `(n, 2)`, with turns on the spot that become arcs where that saves time."""
        circles = np.column_stack([points, np.zeros(len(points)), np.ones(len(points))])
        limits = self.limits.for_kernels
        return self._descend(circles, start, goal, limits)[0]

    def _descend(self, circles: Floats, start: Floats, goal: Floats, limits: Floats) -> tuple[Floats, float]:
        """The parts after the descent from a chain of circles, and their time (s): infinite if the chain is no free path."""
        circles, time = least_time(
            self.space.world, circles, start, goal, self.radius_m, limits, FIRST_STEP_M, LAST_STEP_M
        )
        parts = np.empty((2 * len(circles) - 1, 6))
        chain_parts(circles, len(circles), start, goal, parts)
        return parts, float(time)

    def _one_direction(self, run: Floats, begin: Floats, start: Floats, goal: Floats) -> Floats:
        """A run backwards is the run forwards from its end, driven the other way round."""
        if run[0, 0] >= 0.0:
            return self._forwards(run, begin, start, goal)
        end = _end(begin, run)
        mirrored = np.column_stack([-run[::-1, 0], run[::-1, 1]])
        return _reversed(self._forwards(mirrored, end, np.where(np.isnan(goal), end, goal), start))

    def _forwards(self, motions: Floats, begin: Floats, start: Floats, goal: Floats) -> Floats:
        world, limits = self.space.world, self.limits.for_kernels
        best = _with_turns(parts_of(begin, motions), start, goal)
        least = time_of(best, self.limits)
        for _ in range(PASSES):
            radii = self.search_radius_m * np.array(WIDTHS)
            motions = shortcut(world, begin, motions, radii, limits, SPACING_M, REACH)
            circles = _circles(motions, begin, self.search_radius_m)
            if not _agree(begin, start):
                circles = np.vstack([[*start[:2], 0.0, 1.0], circles])
            if not _agree(_end(begin, motions), goal):
                circles = np.vstack([circles, [*goal[:2], 0.0, 1.0]])
            parts, time = self._descend(circles, start, goal, limits)
            if not time < least:
                break
            best, least = parts, time
            driven = best[best[:, 3] > NOTHING]
            begin, motions = driven[0, :3].copy(), driven[:, 3:5].copy()
        return best


def _agree(pose: Floats, wanted: Floats) -> bool:
    return bool(abs(wrap_angle(pose[2] - wanted[2])) < 1e-6)


def _with_turns(parts: Floats, start: Floats, goal: Floats) -> Floats:
    """The parts with turns on the spot before and after them where the yaws ask for it."""
    rows = []
    if not _agree(parts[0, :3], start):
        rows.append([*start, 0.0, 0.0, float(wrap_angle(parts[0, 2] - start[2]))])
    rows.extend(parts.tolist())
    end = _end(parts[0, :3], parts[:, 3:5])
    if not np.isnan(goal[2]) and not _agree(end, goal):
        rows.append([*end, 0.0, 0.0, float(wrap_angle(goal[2] - end[2]))])
    return np.array(rows)


def _circles(motions: Floats, begin: Floats, radius_m: float) -> Floats:
    """The chain of circles `(n, 4)` of motions (all forwards); circles without an arc are put at ends that are lines."""
    parts = parts_of(begin, motions)
    end = np.array([*_end(begin, motions), 0.0, 0.0, 0.0])
    arcs = [part for part in parts if part[4] != 0.0]
    first_side = float(np.sign(arcs[0][4])) if arcs else 1.0
    last_side = float(np.sign(arcs[-1][4])) if arcs else 1.0
    rows = [_circle(part, 1.0 / abs(part[4]), float(np.sign(part[4]))) for part in arcs]
    if parts[0, 4] == 0.0:
        rows.insert(0, _circle(parts[0], radius_m, first_side))
    if parts[-1, 4] == 0.0 or len(rows) == 1:
        rows.append(_circle(end, radius_m, -last_side if parts[-1, 4] else last_side))
    return np.array(rows)


def _circle(part: Floats, radius_m: float, side: float) -> list[float]:
    x, y, yaw = part[:3]
    return [x - side * radius_m * np.sin(yaw), y + side * radius_m * np.cos(yaw), radius_m, side]


def _runs(motions: Floats) -> list[Floats]:
    """The motions cut where the direction changes."""
    return list(np.split(motions, np.flatnonzero(np.diff(np.sign(motions[:, 0]))) + 1))


def _end(begin: Floats, motions: Floats) -> Floats:
    """The pose after the motions."""
    parts = parts_of(begin, np.vstack([motions, [0.0, 0.0]]))
    return np.asarray(parts[-1, :3])


def _reversed(parts: Floats) -> Floats:
    """The same parts driven backwards, last first."""
    out = parts[::-1].copy()
    for row, part in zip(out, parts[::-1], strict=True):
        row[:3] = _end(part[:3], part[None, 3:5])
        row[2] += part[5]
        row[3], row[5] = -part[3], -part[5]
    return out
