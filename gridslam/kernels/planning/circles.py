"""Travel time of a path, and a local search for less of it, over a chain of oriented circles joined by their tangents.

A circle is (x, y, radius, side): side +1 is driven counter-clockwise, -1 clockwise; radius 0 is a turn on the spot. The first
circle touches the start pose, the last one the goal pose, so the heading is continuous for any choice of circles. Paths are
arrays of parts, whose columns `drive_limits` names.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.planning.clearance import CollisionWorld, is_free, is_free_to_turn_in_place
from gridslam.kernels.planning.drive_limits import (
    ANGLE,
    CURVATURE,
    LENGTH,
    YAW,
    DriveLimits,
    X,
    Y,
    speed_on,
)

RADIUS, SIDE = 2, 3  # columns of circles `(n, 4)`, after X and Y
_FULL_CIRCLE = 2.0 * np.pi
_ZERO = 1e-9
_FULL_CIRCLE_TOLERANCE = 1e-6  # rad; an arc this close to a full turn has length 0
_MIN_GAIN_S = 1e-4
MAX_ROUNDS = 12  # largest number of rounds over all circles at one step size
MOVES = 14  # number of moves of a circle: 8 shifts, 4 changes of radius, reversing it, leaving it out


@compiled
def travel_time(parts: NDArray[np.float64], limits: DriveLimits, speeds: NDArray[np.float64]) -> float:
    """Shortest time (s) to drive the parts `(n, 6)` from rest to rest; writes the speeds at the joints to `speeds` `(n + 1,)`.

    A forward pass applies the acceleration, a backward pass the deceleration. On each part the speed rises to what the part's
    curvature allows, or as far as the part's length permits.
    """
    n = parts.shape[0]
    speeds[0] = 0.0
    for k in range(n):
        length, cap = abs(parts[k, LENGTH]), _max_speed(parts, k, limits)
        reached = np.sqrt(speeds[k] ** 2 + 2.0 * limits.acceleration * length)
        after = _max_speed(parts, k + 1, limits) if k + 1 < n else 0.0
        speeds[k] = min(speeds[k], cap)
        speeds[k + 1] = min(reached, cap, after)
        if k + 1 < n and parts[k + 1, LENGTH] * parts[k, LENGTH] < 0.0:
            speeds[k + 1] = 0.0  # the direction changes here
    total = 0.0
    for k in range(n - 1, -1, -1):
        length, cap = abs(parts[k, LENGTH]), _max_speed(parts, k, limits)
        speeds[k] = min(speeds[k], np.sqrt(speeds[k + 1] ** 2 + 2.0 * limits.deceleration * length))
    for k in range(n):
        total += part_time(parts[k], speeds[k], speeds[k + 1], limits)
    return total


@compiled
def part_time(part: NDArray[np.float64], v0: float, v1: float, limits: DriveLimits) -> float:
    """Time (s) to drive one part `(6,)`, entered at speed v0 and left at v1 (m/s)."""
    if abs(part[ANGLE]) > _ZERO:
        angle, rate, gain = abs(part[ANGLE]), limits.yaw_rate, limits.yaw_acceleration
        if angle * gain < rate * rate:
            return float(2.0 * np.sqrt(angle / gain))
        return float(angle / rate + rate / gain)
    length = abs(part[LENGTH])
    if length < _ZERO:
        return 0.0
    cap = speed_on(part[CURVATURE], limits)
    a, b = limits.acceleration, limits.deceleration
    peak = min(cap, np.sqrt((2.0 * a * b * length + b * v0 * v0 + a * v1 * v1) / (a + b)))
    peak = max(peak, v0, v1)
    used = (peak * peak - v0 * v0) / (2.0 * a) + (peak * peak - v1 * v1) / (2.0 * b)
    return float((peak - v0) / a + (peak - v1) / b + max(length - used, 0.0) / peak)


@compiled
def _max_speed(parts: NDArray[np.float64], k: int, limits: DriveLimits) -> float:
    """Highest speed (m/s) on part k; 0 for a turn on the spot."""
    if abs(parts[k, ANGLE]) > _ZERO:
        return 0.0
    if abs(parts[k, LENGTH]) < _ZERO:
        return float(limits.top_speed)
    return float(speed_on(parts[k, CURVATURE], limits))


@compiled
def chain_parts(
    circles: NDArray[np.float64],
    n: int,
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    parts: NDArray[np.float64],
) -> bool:
    """Write the arcs and lines of a chain of `n` circles to `parts` `(2 n - 1, 6)`; False if two circles have no common tangent.

    A start or goal yaw of NaN is free. The first and the last circle are moved to touch their poses.
    """
    _move_to_touch(circles[0], start)
    _move_to_touch(circles[n - 1], goal)
    yaw = start[YAW]
    for i in range(n):
        x, y, signed = circles[i, X], circles[i, Y], circles[i, RADIUS] * circles[i, SIDE]
        leave = goal[YAW]
        length = 0.0
        if i + 1 < n:
            dx, dy = circles[i + 1, X] - x, circles[i + 1, Y] - y
            apart = np.hypot(dx, dy)
            offset = circles[i + 1, RADIUS] * circles[i + 1, SIDE] - signed
            if apart < _ZERO or abs(offset) > apart + _ZERO:
                return False
            leave = np.arctan2(dy, dx) - np.arcsin(min(max(offset / apart, -1.0), 1.0))
            length = np.sqrt(max(apart * apart - offset * offset, 0.0))
        if np.isnan(yaw):
            yaw = leave
        if np.isnan(leave):
            leave = yaw
        rotation = (circles[i, SIDE] * (leave - yaw)) % _FULL_CIRCLE
        if rotation > _FULL_CIRCLE - _FULL_CIRCLE_TOLERANCE:
            rotation = 0.0
        arc = parts[2 * i]
        arc[X], arc[Y], arc[YAW] = x + signed * np.sin(yaw), y - signed * np.cos(yaw), yaw
        arc[LENGTH], arc[CURVATURE], arc[ANGLE] = circles[i, RADIUS] * rotation, 0.0, 0.0
        if circles[i, RADIUS] > 0.0:
            arc[CURVATURE] = circles[i, SIDE] / circles[i, RADIUS]
        else:
            arc[ANGLE] = rotation if rotation <= np.pi else rotation - _FULL_CIRCLE
            arc[ANGLE] *= circles[i, SIDE]
        if i + 1 < n:
            line = parts[2 * i + 1]
            line[X], line[Y], line[YAW] = x + signed * np.sin(leave), y - signed * np.cos(leave), leave
            line[LENGTH], line[CURVATURE], line[ANGLE] = length, 0.0, 0.0
        yaw = leave
    return True


@compiled
def _move_to_touch(circle: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
    """Move a circle so that it passes through a pose with the pose's heading."""
    signed = circle[RADIUS] * circle[SIDE]
    if circle[RADIUS] > 0.0:
        circle[X], circle[Y] = pose[X] - signed * np.sin(pose[YAW]), pose[Y] + signed * np.cos(pose[YAW])
    else:
        circle[X], circle[Y] = pose[X], pose[Y]


@compiled
def parts_are_free(
    world: CollisionWorld,
    parts: NDArray[np.float64],
    first: int,
    last: int,
) -> bool:
    """Whether the robot collides with nothing on the parts `first` to `last - 1`."""
    for k in range(max(first, 0), min(last, parts.shape[0])):
        x, y, yaw, length, curvature, angle = parts[k]
        if abs(angle) > _ZERO and not is_free_to_turn_in_place(world, x, y, yaw, angle):
            return False
        if abs(length) > _ZERO and not is_free(world, x, y, yaw=yaw, length=length, curvature=curvature):
            return False
    return True


@compiled
def minimise_travel_time(
    world: CollisionWorld,
    circles: NDArray[np.float64],
    start: NDArray[np.float64],
    goal: NDArray[np.float64],
    radius: float,
    limits: DriveLimits,
    first_step: float,
    last_step: float,
) -> tuple[NDArray[np.float64], float]:
    """Circles `(m, 4)` after a pattern search for less travel time, and that time (s); infinite if the given chain is not free.

    Each circle in turn is shifted, widened, narrowed, widened about its outermost point, reversed or left out. A change that
    takes less time, within the robot's `limits`, and stays free in the `world` between the poses `start` and `goal` (3,) is
    kept. The step size is halved from `first_step` (m) down to `last_step` (m); `radius` (m) is the smallest radius of a
    circle.
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
        while improved and rounds < MAX_ROUNDS:
            improved = False
            rounds += 1
            i = 0
            while i < n:
                for move in range(MOVES):
                    m = _apply_move(
                        now, n, i=i, move=move, step=step, radius=radius, parts=parts, trial=trial
                    )
                    if m == 0:
                        continue
                    there = trial_parts[: 2 * m - 1]
                    if not chain_parts(trial, m, start, goal, there):
                        continue
                    new = travel_time(there, limits, speeds)
                    if not new <= time - _MIN_GAIN_S:
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
def _apply_move(
    circles: NDArray[np.float64],
    n: int,
    i: int,
    move: int,
    step: float,
    radius: float,
    parts: NDArray[np.float64],
    trial: NDArray[np.float64],
) -> int:
    """Write the circles after one move of circle i to `trial`; returns their number, 0 if the move does not apply."""
    trial[:n] = circles[:n]
    inner = 0 < i < n - 1
    if move < 8:
        if not inner:
            return 0
        angle = 0.25 * np.pi * move
        trial[i, X] += step * np.cos(angle)
        trial[i, Y] += step * np.sin(angle)
        return n
    if move < 12:
        if circles[i, RADIUS] == 0.0 and radius > 0.0:
            return 0  # an end where the robot turns on the spot, or arrives with any heading
        change = step if move % 2 == 0 else -step
        trial[i, RADIUS] = max(circles[i, RADIUS] + change, radius)
        if trial[i, RADIUS] == circles[i, RADIUS] or (move >= 10 and not inner):
            return 0
        if move >= 10:
            arc = parts[2 * i]
            outwards = arc[YAW] + 0.5 * arc[LENGTH] * arc[CURVATURE] - 0.5 * np.pi * circles[i, SIDE]
            grown = trial[i, RADIUS] - circles[i, RADIUS]
            trial[i, X] -= grown * np.cos(outwards)
            trial[i, Y] -= grown * np.sin(outwards)
        return n
    if move == 12:
        trial[i, SIDE] = -circles[i, SIDE]
        return n
    if not inner:
        return 0
    for k in range(i, n - 1):
        trial[k] = circles[k + 1]
    return n - 1
