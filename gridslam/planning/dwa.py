"""The Dynamic Window Approach over wheel speeds (Fox et al. 1997; handmap-slam, paper section 5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.wheel_window import free_distances

Floats = NDArray[np.float64]

STANDING_MPS = 1e-9  # below this forward speed the robot stands still or turns on the spot


@dataclass(frozen=True, slots=True)
class WheelSpeeds:
    """Speeds of the left and the right wheel along the ground (m/s)."""

    left_mps: float
    right_mps: float

    @staticmethod
    def standing() -> WheelSpeeds:
        """Both wheels stopped."""
        return WheelSpeeds(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class DifferentialDrive:
    """A round robot on two wheels: radius, distance between the wheels (m), and the limits of its drive."""

    radius_m: float
    base_m: float
    acceleration_mps2: float  # of each wheel
    max_speed_mps: float  # of each wheel
    max_yaw_rate_radps: float


@dataclass(frozen=True, slots=True)
class DwaSettings:
    """Settings of the choice of wheel speeds.

    period_s: Time between commands.
    delay_s: Time until a command takes effect.
    samples: Number of speeds tried for each wheel.
    prediction_s: The heading is scored after this time.
    margin_m: Clearance kept from obstacles beyond the robot's radius.
    max_clearance_m: An arc that is free for this distance has the full clearance score.
    heading_weight, clearance_weight, speed_weight: Weights of the three scores.
    """

    period_s: float
    delay_s: float
    samples: int
    prediction_s: float
    margin_m: float
    max_clearance_m: float
    heading_weight: float
    clearance_weight: float
    speed_weight: float


def choose_speeds(
    current: WheelSpeeds, target: Floats, obstacles: Floats, drive: DifferentialDrive, settings: DwaSettings
) -> WheelSpeeds:
    """The admissible wheel speeds with the highest score that the drive can reach from the current ones.

    `target` `(2,)` is the point to head for and `obstacles` `(m, 2)` are obstacle points, both in the robot's frame (m). The
    score is the weighted sum of heading, clearance and speed, each from 0 to 1. Speeds are admissible if the robot can stop
    before the nearest obstacle on its arc. If none are, the robot brakes.
    """
    speeds = reachable_speeds(current, drive, settings)
    radius_m = drive.radius_m + settings.margin_m
    clearances = np.asarray(
        free_distances(speeds, obstacles, drive.base_m, radius_m, settings.max_clearance_m)
    )
    fastest = np.abs(speeds).max(axis=1)
    needed = fastest * (settings.period_s + settings.delay_s) + fastest**2 / (2.0 * drive.acceleration_mps2)
    forward = speeds.mean(axis=1)
    admissible = (clearances > needed) | (np.abs(forward) < STANDING_MPS)
    if not admissible.any():
        return _braking(current, drive, settings)
    score = (
        settings.heading_weight * heading_scores(speeds, target, drive, settings)
        + settings.clearance_weight * clearances / settings.max_clearance_m
        + settings.speed_weight * np.clip(forward, 0.0, None) / drive.max_speed_mps
    )
    best = int(np.where(admissible, score, -np.inf).argmax())
    return WheelSpeeds(float(speeds[best, 0]), float(speeds[best, 1]))


def reachable_speeds(current: WheelSpeeds, drive: DifferentialDrive, settings: DwaSettings) -> Floats:
    """Wheel speeds `(n, 2)` that the acceleration allows within one period; includes standing still if that is reachable.

    The robot only drives forwards: if it rolls back, it brakes.
    """
    step = drive.acceleration_mps2 * settings.period_s
    top = drive.max_speed_mps
    axes = [
        np.linspace(max(v - step, -top), min(v + step, top), settings.samples)
        for v in (current.left_mps, current.right_mps)
    ]
    left, right = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
    speeds = np.column_stack([left, right])
    if max(abs(current.left_mps), abs(current.right_mps)) <= step:
        speeds = np.concatenate([speeds, np.zeros((1, 2))])
    turning = np.abs(speeds[:, 1] - speeds[:, 0]) / drive.base_m
    kept = turning <= max(drive.max_yaw_rate_radps, float(turning.min()))
    forward = speeds.mean(axis=1)
    kept &= forward >= min(-STANDING_MPS, float(forward[kept].max()))
    return np.asarray(speeds[kept])


def heading_scores(speeds: Floats, target: Floats, drive: DifferentialDrive, settings: DwaSettings) -> Floats:
    """Scores `(n,)` of wheel speeds `(n, 2)`: 1 if the robot faces the target after `prediction_s`, 0 if it faces away."""
    forward, yaw_rate = speeds.mean(axis=1), (speeds[:, 1] - speeds[:, 0]) / drive.base_m
    yaw = yaw_rate * settings.prediction_s
    half = 0.5 * yaw
    chord = forward * settings.prediction_s * np.sinc(half / np.pi)
    x, y = chord * np.cos(half), chord * np.sin(half)
    bearing = np.arctan2(target[1] - y, target[0] - x)
    off = np.abs(np.arctan2(np.sin(bearing - yaw), np.cos(bearing - yaw)))
    return np.asarray(1.0 - off / np.pi)


def _braking(current: WheelSpeeds, drive: DifferentialDrive, settings: DwaSettings) -> WheelSpeeds:
    """Both wheels slowed down in the same proportion, so that the robot stays on its arc."""
    fastest = max(abs(current.left_mps), abs(current.right_mps))
    factor = max(1.0 - drive.acceleration_mps2 * settings.period_s / fastest, 0.0) if fastest > 0.0 else 0.0
    return WheelSpeeds(current.left_mps * factor, current.right_mps * factor)
