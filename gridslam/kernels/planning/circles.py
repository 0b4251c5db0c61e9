"""A path as a chain of oriented circles joined by their tangents, its travel time, and the descent to less of it.

A circle is (x, y, radius, side): side +1 is driven counter-clockwise, -1 clockwise; radius 0 is a turn on the spot. The first
circle touches the start pose, the last the goal pose. Heading is continuous by construction, whatever the circles are.
A part is (x, y, yaw, length, curvature, angle): the pose where it begins, its length (m) and curvature (1/m), and the angle
(rad) turned on the spot. Limits are top speed, lateral acceleration, turn rate, acceleration, deceleration, turn acceleration.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import World, is_free, is_free_to_turn
from gridslam.kernels.planning.search import speed_on

_FULL = 2.0 * np.pi
_NOTHING = 1e-9
_ROUNDED = 1e-6  # a turn this near to a full one is none
_GAIN_S = 1e-4


@compiled
def travel_time(
    parts: NDArray[np.float64], limits: NDArray[np.float64], speeds: NDArray[np.float64]
) -> float:
    """Least time (s) to drive the parts from rest to rest; `speeds` `(n + 1,)` receives the speeds at the joints.

    A pass forwards with the acceleration, one backwards with the deceleration; on each part the speed rises to what the part
    allows, or as far as its length lets it.
    """
    n = parts.shape[0]
    speeds[0] = 0.0
    for k in range(n):
        length, cap = abs(parts[k, 3]), _cap(parts, k, limits)
        reached = np.sqrt(speeds[k] ** 2 + 2.0 * limits[3] * length)
        after = _cap(parts, k + 1, limits) if k + 1 < n else 0.0
        speeds[k] = min(speeds[k], cap)
        speeds[k + 1] = min(reached, cap, after)
        if k + 1 < n and parts[k + 1, 3] * parts[k, 3] < 0.0:
            speeds[k + 1] = 0.0  # the direction changes here
    total = 0.0
    for k in range(n - 1, -1, -1):
        length, cap = abs(parts[k, 3]), _cap(parts, k, limits)
        speeds[k] = min(speeds[k], np.sqrt(speeds[k + 1] ** 2 + 2.0 * limits[4] * length))
    for k in range(n):
        total += part_time(parts[k], speeds[k], speeds[k + 1], limits)
    return total


@compiled
def part_time(part: NDArray[np.float64], v0: float, v1: float, limits: NDArray[np.float64]) -> float:
    """Time (s) on one part entered at v0 and left at v1 (m/s)."""
    if abs(part[5]) > _NOTHING:
        angle, rate, gain = abs(part[5]), limits[2], limits[5]
        if angle * gain < rate * rate:
            return float(2.0 * np.sqrt(angle / gain))
        return float(angle / rate + rate / gain)
    length = abs(part[3])
    if length < _NOTHING:
        return 0.0
    cap = speed_on(part[4], limits[0], limits[1], limits[2])
    a, b = limits[3], limits[4]
    peak = min(cap, np.sqrt((2.0 * a * b * length + b * v0 * v0 + a * v1 * v1) / (a + b)))
    peak = max(peak, v0, v1)
    used = (peak * peak - v0 * v0) / (2.0 * a) + (peak * peak - v1 * v1) / (2.0 * b)
    return float((peak - v0) / a + (peak - v1) / b + max(length - used, 0.0) / peak)


@compiled
def _cap(parts: NDArray[np.float64], k: int, limits: NDArray[np.float64]) -> float:
    if abs(parts[k, 5]) > _NOTHING:
        return 0.0
    if abs(parts[k, 3]) < _NOTHING:
        return float(limits[0])
    return float(speed_on(parts[k, 4], limits[0], limits[1], limits[2]))


@compiled
def chain_parts(
    circles: NDArray[np.float64],
    n: int,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    parts: NDArray[np.float64],
) -> bool:
    """Fill `parts` `(2 n - 1, 6)` with arc, line, arc, ...; False where two circles have no such tangent.

    A start or goal yaw of NaN is free. The first and the last circle are moved to touch their poses.
    """
    _touch(circles[0], start)
    _touch(circles[n - 1], goal)
    yaw = start[2]
    for i in range(n):
        x, y, signed = circles[i, 0], circles[i, 1], circles[i, 2] * circles[i, 3]
        leave = goal[2]
        length = 0.0
        if i + 1 < n:
            dx, dy = circles[i + 1, 0] - x, circles[i + 1, 1] - y
            apart = np.hypot(dx, dy)
            offset = circles[i + 1, 2] * circles[i + 1, 3] - signed
            if apart < _NOTHING or abs(offset) > apart + _NOTHING:
                return False
            leave = np.arctan2(dy, dx) - np.arcsin(min(max(offset / apart, -1.0), 1.0))
            length = np.sqrt(max(apart * apart - offset * offset, 0.0))
        if np.isnan(yaw):
            yaw = leave
        if np.isnan(leave):
            leave = yaw
        turn = (circles[i, 3] * (leave - yaw)) % _FULL
        if turn > _FULL - _ROUNDED:
            turn = 0.0
        arc = parts[2 * i]
        arc[0], arc[1], arc[2] = x + signed * np.sin(yaw), y - signed * np.cos(yaw), yaw
        arc[3], arc[4], arc[5] = circles[i, 2] * turn, 0.0, 0.0
        if circles[i, 2] > 0.0:
            arc[4] = circles[i, 3] / circles[i, 2]
        else:
            arc[5] = turn if turn <= np.pi else turn - _FULL
            arc[5] *= circles[i, 3]
        if i + 1 < n:
            line = parts[2 * i + 1]
            line[0], line[1], line[2] = x + signed * np.sin(leave), y - signed * np.cos(leave), leave
            line[3], line[4], line[5] = length, 0.0, 0.0
        yaw = leave
    return True


@compiled
def _touch(circle: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
    signed = circle[2] * circle[3]
    if circle[2] > 0.0:
        circle[0], circle[1] = pose[0] - signed * np.sin(pose[2]), pose[1] + signed * np.cos(pose[2])
    else:
        circle[0], circle[1] = pose[0], pose[1]


@compiled
def parts_are_free(
    world: World,
    parts: NDArray[np.float64],
    first: int,
    last: int,
) -> bool:
    """Whether the parts from `first` up to, but without, `last` touch nothing."""
    for k in range(max(first, 0), min(last, parts.shape[0])):
        x, y, yaw, length, curvature, angle = parts[k]
        if abs(angle) > _NOTHING and not is_free_to_turn(world, x, y, yaw, angle):
            return False
        if abs(length) > _NOTHING and not is_free(world, x, y, yaw, length, curvature):
            return False
    return True


@compiled
def least_time(
    world: World,
    circles: NDArray[np.float64],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    radius: float,
    limits: NDArray[np.float64],
    first_step: float,
    last_step: float,
) -> tuple[NDArray[np.float64], float]:
    """Circles `(m, 4)` with the least travel time (s) found from the given ones by a pattern search, and that time.

    Every circle in turn is shifted, widened, narrowed, widened about its outermost point, reversed or left out; what takes
    less time and stays clear is kept. The steps (m) are halved from `first_step` to `last_step`. The time is infinite if
    the given circles are no free path.
    """
    now = circles.copy()
    n = now.shape[0]
    parts, trial_parts = np.empty((2 * n - 1, 6)), np.empty((2 * n - 1, 6))
    speeds = np.empty(2 * n)
    if not chain_parts(now, n, start, goal, parts) or not parts_are_free(world, parts, 0, 2 * n - 1):
        return now, np.inf
    time = travel_time(parts, limits, speeds)
    trial = np.empty_like(now)
    step = first_step
    while step >= last_step:
        improved = True
        rounds = 0
        while improved and rounds < 12:
            improved = False
            rounds += 1
            i = 0
            while i < n:
                for move in range(14):
                    m = _moved(now, n, i, move, step, radius, parts, trial)
                    if m == 0:
                        continue
                    there = trial_parts[: 2 * m - 1]
                    if not chain_parts(trial, m, start, goal, there):
                        continue
                    new = travel_time(there, limits, speeds)
                    if not new <= time - _GAIN_S:
                        continue
                    if not parts_are_free(world, there, 2 * i - 3, 2 * i + 4):
                        continue
                    time, n, improved = new, m, True
                    now[:n] = trial[:n]
                    parts[: 2 * n - 1] = there
                    if i >= n:
                        break
                i += 1
        step *= 0.5
    return now[:n].copy(), time


@compiled
def _moved(
    circles: NDArray[np.float64],
    n: int,
    i: int,
    move: int,
    step: float,
    radius: float,
    parts: NDArray[np.float64],
    trial: NDArray[np.float64],
) -> int:
    """Write the circles after one move of circle i to `trial`; returns their number, 0 where the move does not apply."""
    trial[:n] = circles[:n]
    inner = 0 < i < n - 1
    if move < 8:
        if not inner:
            return 0
        angle = 0.25 * np.pi * move
        trial[i, 0] += step * np.cos(angle)
        trial[i, 1] += step * np.sin(angle)
        return n
    if move < 12:
        if circles[i, 2] == 0.0 and radius > 0.0:
            return 0  # an end where the robot turns on the spot, or arrives with any heading
        change = step if move % 2 == 0 else -step
        trial[i, 2] = max(circles[i, 2] + change, radius)
        if trial[i, 2] == circles[i, 2] or (move >= 10 and not inner):
            return 0
        if move >= 10:
            arc = parts[2 * i]
            outwards = arc[2] + 0.5 * arc[3] * arc[4] - 0.5 * np.pi * circles[i, 3]
            grown = trial[i, 2] - circles[i, 2]
            trial[i, 0] -= grown * np.cos(outwards)
            trial[i, 1] -= grown * np.sin(outwards)
        return n
    if move == 12:
        trial[i, 3] = -circles[i, 3]
        return n
    if not inner:
        return 0
    for k in range(i, n - 1):
        trial[k] = circles[k + 1]
    return n - 1
