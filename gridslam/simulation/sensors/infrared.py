"""Triangulating infrared rangers on servos, swept while the robot stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, Range, as_float32
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Scene
from gridslam.simulation.sensors.extrinsics import planar
from gridslam.simulation.sensors.sensor_config import Infrared

Array = NDArray[np.float64]
MAX_READING = 2.0  # readings are clipped at this multiple of range_max_m
MAX_CAST = 4.0  # surfaces up to this multiple of range_max_m still give a reading
EDGE_M = 0.03  # range step across the beam from which an edge is assumed


@dataclass(frozen=True, slots=True)
class _Reading:
    taken_ns: int
    event: Range


class InfraredRangers:
    """Sweeps all rangers on demand and returns their readings as the servos turn."""

    def __init__(self, configs: tuple[Infrared, ...], start_ns: int, rng: np.random.Generator) -> None:
        self._configs = configs
        self._start_ns = start_ns
        self._rng = rng
        self._waiting: list[_Reading] = []

    @property
    def is_sweeping(self) -> bool:
        """Whether a sweep is in progress; the robot must stand meanwhile."""
        return bool(self._waiting)

    def start(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> None:
        """Start a sweep of all rangers."""
        for config in self._configs:
            self._waiting += self._sweep(config, now_ns, robot, scene)
        self._waiting.sort(key=lambda reading: reading.taken_ns)

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The readings taken since the last call."""
        count = sum(reading.taken_ns <= now_ns for reading in self._waiting) if self._waiting else 0
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return [reading.event for reading in taken]

    def _sweep(self, config: Infrared, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[_Reading]:
        bearings = np.radians(np.arange(config.from_deg, config.to_deg + 1e-9, config.step_deg))
        ranges = read_ranges(
            config, bearings, pose=robot.pose, scene=scene, time_s=now_ns * 1e-9, rng=self._rng
        )
        limits = as_float32(config.range_min_m), as_float32(config.range_max_m)
        readings = []
        for k, (bearing, value) in enumerate(zip(bearings.tolist(), ranges.tolist(), strict=True)):
            taken = now_ns + round((k + 1) * config.seconds_per_step * 1e9)
            event = Range(self._start_ns + taken, config.name, bearing, as_float32(value), *limits)
            readings.append(_Reading(taken, event))
        return readings


def read_ranges(
    config: Infrared, bearings: Array, pose: Array, scene: Scene, time_s: float, rng: np.random.Generator
) -> Array:
    """Readings `(n,)` (m) at servo bearings `(n,)` (rad) of a robot that stands at `pose` `(3,)` in the scene at `time_s`.

    `config` is the ranger; `rng` draws its noise.
    """
    n = len(bearings)
    sensor = se2.compose(pose, planar(config.extrinsics))
    yaws = sensor[2] + bearings + math.radians(config.servo_deviation_deg) * rng.standard_normal(n)
    max_range_m = MAX_CAST * config.range_max_m
    middle = scene.cast(_rays(sensor, yaws), max_range_m, time_s)
    half = np.arctan2(0.5 * config.beam_width_m, np.maximum(middle.ranges_m, 1e-3))
    borders = scene.cast(
        np.concatenate([_rays(sensor, yaws - half), _rays(sensor, yaws + half)]), max_range_m, time_s
    )
    sides = borders.ranges_m.reshape(2, n)
    ranges = _past_edges(config, middle.ranges_m, sides.min(axis=0), sides.max(axis=0), rng)
    ranges = ranges - config.grazing_bias_m * (1.0 / np.maximum(middle.cosines, 0.05) - 1.0)
    ranges = _folded(config, ranges)
    ranges = ranges + (config.noise_m + config.noise_per_m2 * ranges**2) * rng.standard_normal(n)
    wrong = rng.random(n) < config.outliers
    ranges = np.where(wrong, config.range_max_m * rng.random(n), ranges)
    return np.clip(ranges, 0.0, MAX_READING * config.range_max_m)


def _past_edges(config: Infrared, middle: Array, near: Array, far: Array, rng: np.random.Generator) -> Array:
    """Readings of a beam that falls on two surfaces: between them, or beyond either, by its centre of gravity."""
    draw, where = rng.random((2, len(middle)))
    is_edge = (far - near > EDGE_M) & (np.abs(far + near - 2.0 * middle) > 0.5 * (far - near))
    wrong = is_edge & (draw < config.edge_errors)
    far = np.minimum(far, MAX_READING * config.range_max_m)
    return np.where(wrong, near + (1.6 * where - 0.3) * (far - near), middle)


def _folded(config: Infrared, ranges: Array) -> Array:
    """Readings below the minimum range, where the response of a triangulating ranger folds back."""
    near = np.maximum(ranges, 1e-3)
    return np.where(ranges < config.range_min_m, config.range_min_m**2 / near, ranges)


def _rays(sensor: Array, yaws: Array) -> Array:
    return np.column_stack([np.tile(sensor[:2], (len(yaws), 1)), np.cos(yaws), np.sin(yaws)])
