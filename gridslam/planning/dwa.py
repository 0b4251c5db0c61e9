"""The Dynamic Window Approach over wheel speeds (Fox et al. 1997; handmap-slam, paper section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.wheel_window import free_distances

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Drive:
    """What the robot's body can do: a disc on two wheels, lengths in metres and seconds."""

    radius_m: float
    base_m: float
    acceleration_mps2: float  # of each wheel
    max_speed_mps: float  # of each wheel
    max_turn_radps: float


@dataclass(frozen=True, slots=True)
class Window:
    """How commands are chosen.

    `period_s` is the time between commands and `delay_s` that until one takes effect; `samples` speeds of each wheel are tried.
    `look_s`: heading is judged after so long. `margin_m` is kept to obstacles; a way free for `far_m` is clear.
    """

    period_s: float
    delay_s: float
    samples: int
    look_s: float
    margin_m: float
    far_m: float
    heading: float
    clearance: float
    speed: float


@dataclass(frozen=True, slots=True)
class Choice:
    """The wheel speeds chosen (m/s, left and right)."""

    left_mps: float
    right_mps: float


def choose_speeds(
    now: tuple[float, float], target: Floats, obstacles: Floats, drive: Drive, window: Window
) -> Choice:
    """The best admissible wheel speeds within reach of the present ones `now` (m/s, left and right).

    `target` `(2,)` is where to go and `obstacles` `(m, 2)` what stands about, in the robot's frame. Score = heading + clearance
    + speed, each from 0 to 1 and weighted; admissible is what can be stopped before the nearest obstacle on its arc. Where
    nothing is admissible the robot brakes.
    """
    speeds = reachable(now, drive, window)
    ways = np.asarray(
        free_distances(speeds, obstacles, drive.base_m, drive.radius_m + window.margin_m, window.far_m)
    )
    fastest = np.abs(speeds).max(axis=1)
    needed = fastest * (window.period_s + window.delay_s) + fastest**2 / (2.0 * drive.acceleration_mps2)
    forward = speeds.mean(axis=1)
    admissible = (ways > needed) | (np.abs(forward) < 1e-9)
    if not admissible.any():
        return Choice(*_braking(now, drive, window))
    score = (
        window.heading * heading_scores(speeds, target, drive, window)
        + window.clearance * ways / window.far_m
        + window.speed * np.clip(forward, 0.0, None) / drive.max_speed_mps
    )
    best = int(np.where(admissible, score, -np.inf).argmax())
    return Choice(float(speeds[best, 0]), float(speeds[best, 1]))


def reachable(now: tuple[float, float], drive: Drive, window: Window) -> Floats:
    """Wheel speeds `(n, 2)` that the acceleration lets the robot reach in one period; standing still where that is one of them.

    The robot drives ahead only: where it rolls back, it brakes.
    """
    step = drive.acceleration_mps2 * window.period_s
    top = drive.max_speed_mps
    axes = [np.linspace(max(v - step, -top), min(v + step, top), window.samples) for v in now]
    left, right = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
    speeds = np.column_stack([left, right])
    if max(abs(v) for v in now) <= step:
        speeds = np.concatenate([speeds, np.zeros((1, 2))])
    turning = np.abs(speeds[:, 1] - speeds[:, 0]) / drive.base_m
    kept = turning <= max(drive.max_turn_radps, float(turning.min()))
    forward = speeds.mean(axis=1)
    kept &= forward >= min(-1e-9, float(forward[kept].max()))
    return np.asarray(speeds[kept])


def heading_scores(speeds: Floats, target: Floats, drive: Drive, window: Window) -> Floats:
    """1 where the robot would look at the target after `look_s` of these speeds `(n, 2)`, 0 where straight away from it."""
    forward, turn = speeds.mean(axis=1), (speeds[:, 1] - speeds[:, 0]) / drive.base_m
    yaw = turn * window.look_s
    half = 0.5 * yaw
    chord = forward * window.look_s * np.sinc(half / np.pi)
    x, y = chord * np.cos(half), chord * np.sin(half)
    bearing = np.arctan2(target[1] - y, target[0] - x)
    off = np.abs(np.arctan2(np.sin(bearing - yaw), np.cos(bearing - yaw)))
    return np.asarray(1.0 - off / np.pi)


def _braking(now: tuple[float, float], drive: Drive, window: Window) -> tuple[float, float]:
    """Both wheels slowed down in the same proportion, so that the robot stays on its arc."""
    top = max(abs(now[0]), abs(now[1]))
    share = max(1.0 - drive.acceleration_mps2 * window.period_s / top, 0.0) if top > 0.0 else 0.0
    return now[0] * share, now[1] * share
