"""Improvement of a drivable path: less travel time between the same poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.poses import wrap_angle
from gridslam.kernels.planning.circles import chain_parts, minimise_travel_time
from gridslam.kernels.planning.drive_limits import ANGLE, CURVATURE, LENGTH, YAW
from gridslam.kernels.planning.shortcut import shortcut
from gridslam.planning.space import Space
from gridslam.planning.travel_time import ZERO, SpeedLimits, parts_of, travel_time_of

Floats = NDArray[np.float64]

RADIUS_FACTORS = (1.0, 2.0, 4.0)  # radii of shortcuts, in units of the smallest radius
SPACING_M = 0.5  # distance between the joints that shortcuts connect
MAX_JOINTS_AHEAD = 40  # largest number of joints from one end of a shortcut to the other
INITIAL_STEP_M, FINAL_STEP_M = 0.64, 0.005  # steps of the local search over circles
SAME_YAW_RAD = 1e-6


@dataclass(frozen=True, slots=True)
class Refiner:
    """Improves paths of one robot in one space; all poses are in the frame of `space`.

    `radius_m` is the smallest radius of the robot's arcs, 0 if it turns on the spot anywhere; `search_radius_m` is the smallest
    radius of the motions to improve.
    """

    space: Space
    radius_m: float
    search_radius_m: float
    limits: SpeedLimits
    passes: int = 2  # number of passes of shortcuts and local search
    max_motions: int = (
        120  # improved at once: the time of the local search grows with the square of their number
    )

    def refine(self, motions: Floats, first_pose: Floats, start: Floats, goal: Floats) -> Floats:
        """Parts `(m, 6)` from `start` to `goal` that take at most the time of the motions `(n, 2)` (length, curvature).

        The motions lead from `first_pose`; negative lengths are driven backwards. The robot turns on the spot at the start if the
        yaw of `first_pose` differs from that of `start`, and at the goal if the yaw at the end of the motions differs from that
        of `goal`. A goal yaw of NaN is free.
        """
        refined = []
        runs = _split_into_runs(motions, self.max_motions)
        for i, run in enumerate(runs):
            end = _end_pose(first_pose, run)
            first = start if i == 0 else first_pose
            last = goal if i == len(runs) - 1 else end
            refined.append(self._refine_run(run, first_pose, first, last))
            first_pose = end
        return np.vstack(refined)

    def along_polyline(self, points: Floats, start: Floats, goal: Floats) -> Floats:
        """Parts `(m, 6)` along a polyline `(n, 2)`; turns on the spot at its corners become arcs where that saves time."""
        circles = np.column_stack([points, np.zeros(len(points)), np.ones(len(points))])
        return self._descend(circles, start, goal)[0]

    def _descend(self, circles: Floats, start: Floats, goal: Floats) -> tuple[Floats, float]:
        """Parts `(2 n - 1, 6)` after the local search from a chain of circles, and their time (s): infinite if not free.

        `circles` `(n, 4)` are (x, y, radius, side); side is 1 for left and -1 for right.
        """
        circles, time = minimise_travel_time(
            world=self.space.world,
            circles=circles,
            start=start,
            goal=goal,
            radius=self.radius_m,
            limits=self.limits.for_kernels,
            first_step=INITIAL_STEP_M,
            last_step=FINAL_STEP_M,
        )
        parts = np.empty((2 * len(circles) - 1, 6))
        chain_parts(circles, len(circles), start, goal, parts)
        return parts, float(time)

    def _refine_run(self, run: Floats, first_pose: Floats, start: Floats, goal: Floats) -> Floats:
        """The improved parts of a run of motions; a run backwards is improved as a run forwards from its end, then reversed."""
        if run[0, 0] >= 0.0:
            return self._refine_forwards(run, first_pose, start, goal)
        end = _end_pose(first_pose, run)
        mirrored = np.column_stack([-run[::-1, 0], run[::-1, 1]])
        return _driven_backwards(
            self._refine_forwards(mirrored, end, np.where(np.isnan(goal), end, goal), start)
        )

    def _refine_forwards(self, motions: Floats, first_pose: Floats, start: Floats, goal: Floats) -> Floats:
        """Alternate shortcuts and local search until the travel time no longer falls."""
        world, limits = self.space.world, self.limits.for_kernels
        best = _with_turns_in_place(parts_of(first_pose, motions), start, goal)
        best_time = travel_time_of(best, self.limits)
        for _ in range(self.passes):
            radii = self.search_radius_m * np.array(RADIUS_FACTORS)
            motions = shortcut(
                world=world,
                start=first_pose,
                parts=motions,
                radii=radii,
                limits=limits,
                spacing=SPACING_M,
                max_joints_ahead=MAX_JOINTS_AHEAD,
            )
            circles = _circles(motions, first_pose, self.search_radius_m)
            if not _has_same_yaw(first_pose, start):
                circles = np.vstack([[*start[:2], 0.0, 1.0], circles])
            if not _has_same_yaw(_end_pose(first_pose, motions), goal):
                circles = np.vstack([circles, [*goal[:2], 0.0, 1.0]])
            parts, time = self._descend(circles, start, goal)
            if not time < best_time:
                break
            best, best_time = parts, time
            driven = best[best[:, LENGTH] > ZERO]
            first_pose, motions = driven[0, :3].copy(), driven[:, LENGTH:ANGLE].copy()
        return best


def _has_same_yaw(pose: Floats, wanted: Floats) -> bool:
    """Whether two poses have the same heading; False if either is NaN."""
    return bool(abs(wrap_angle(pose[2] - wanted[2])) < SAME_YAW_RAD)


def _with_turns_in_place(parts: Floats, start: Floats, goal: Floats) -> Floats:
    """The parts, with turns on the spot before and after them where the yaws differ from those wanted."""
    rows = []
    if not _has_same_yaw(parts[0, :3], start):
        rows.append([*start, 0.0, 0.0, float(wrap_angle(parts[0, YAW] - start[YAW]))])
    rows.extend(parts.tolist())
    end = _end_pose(parts[0, :3], parts[:, LENGTH:ANGLE])
    if not np.isnan(goal[YAW]) and not _has_same_yaw(end, goal):
        rows.append([*end, 0.0, 0.0, float(wrap_angle(goal[YAW] - end[YAW]))])
    return np.array(rows)


def _circles(motions: Floats, first_pose: Floats, radius_m: float) -> Floats:
    """The chain of circles `(n, 4)` (x, y, radius, side) of forward motions; a circle is added at each end that is a line."""
    parts = parts_of(first_pose, motions)
    end = np.array([*_end_pose(first_pose, motions), 0.0, 0.0, 0.0])
    arcs = [part for part in parts if part[CURVATURE] != 0.0]
    first_side = float(np.sign(arcs[0][CURVATURE])) if arcs else 1.0
    last_side = float(np.sign(arcs[-1][CURVATURE])) if arcs else 1.0
    rows = [_circle(part, 1.0 / abs(part[CURVATURE]), float(np.sign(part[CURVATURE]))) for part in arcs]
    if parts[0, CURVATURE] == 0.0:
        rows.insert(0, _circle(parts[0], radius_m, first_side))
    if parts[-1, CURVATURE] == 0.0 or len(rows) == 1:
        rows.append(_circle(end, radius_m, -last_side if parts[-1, CURVATURE] else last_side))
    return np.array(rows)


def _circle(part: Floats, radius_m: float, side: float) -> list[float]:
    """The circle (x, y, radius, side) that is tangent to the start of a part."""
    x, y, yaw = part[:3]
    return [x - side * radius_m * np.sin(yaw), y + side * radius_m * np.cos(yaw), radius_m, side]


def _split_into_runs(motions: Floats, max_motions: int) -> list[Floats]:
    """The motions in runs of one driving direction and at most `max_motions` motions each."""
    runs = np.split(motions, np.flatnonzero(np.diff(np.sign(motions[:, 0]))) + 1)
    return [run[first : first + max_motions] for run in runs for first in range(0, len(run), max_motions)]


def _end_pose(first_pose: Floats, motions: Floats) -> Floats:
    """The pose `(3,)` after the motions."""
    parts = parts_of(first_pose, np.vstack([motions, [0.0, 0.0]]))
    return np.asarray(parts[-1, :3])


def _driven_backwards(parts: Floats) -> Floats:
    """The same parts driven backwards, last first."""
    out = parts[::-1].copy()
    for row, part in zip(out, parts[::-1], strict=True):
        row[:3] = _end_pose(part[:3], part[None, LENGTH:ANGLE])
        row[YAW] += part[ANGLE]
        row[LENGTH], row[ANGLE] = -part[LENGTH], -part[ANGLE]
    return out
