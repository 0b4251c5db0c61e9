"""The planar lidar: rays cast from the robot's pose at the time of each beam, and the errors of the readings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan, as_float32, readonly
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.scene import Hits, Scene
from gridslam.simulation.sensors.extrinsics import planar
from gridslam.simulation.sensors.sensor_config import Lidar
from gridslam.simulation.sensors.timing import Schedule

Array = NDArray[np.float64]
MAX_GRAZING_FACTOR = 10.0  # largest factor of the noise at grazing incidence


class LidarSensor:
    """Starts sweeps on schedule and returns each when its last beam has been measured."""

    def __init__(self, config: Lidar, start_ns: int, rng: np.random.Generator) -> None:
        self.config = config
        self._rng = rng
        self._schedule = Schedule(config, start_ns, rng)
        span = math.radians(config.field_of_view_deg)
        steps = config.beams if config.field_of_view_deg == 360.0 else config.beams - 1
        self._first = as_float32(-0.5 * span)
        self._step = as_float32(span / steps)
        self.bearings: Array = np.asarray(self._first + self._step * np.arange(config.beams), np.float64)
        self._between_s = config.sweep_s / max(config.beams - 1, 1)

    def poll(self, now_ns: int, robot: DrivenRobot, scene: Scene) -> list[Event]:
        """The scans that are complete at this step."""
        start_ns_of_sweep = self._schedule.next_ns
        if start_ns_of_sweep + round(1e9 * self.config.sweep_s) > now_ns:
            return []
        self._schedule.advance()
        ranges = self.sweep(start_ns_of_sweep * 1e-9, robot, scene)
        stamp = self._schedule.stamp_ns(start_ns_of_sweep)
        return [] if stamp is None else [self._message(stamp, ranges)]

    def sweep(self, start_s: float, robot: DrivenRobot, scene: Scene) -> Array:
        """Ranges `(beams,)` (m) of one sweep that starts at `start_s`, infinite where there was no echo."""
        config = self.config
        times: Array = np.asarray(start_s + self._between_s * np.arange(config.beams), np.float64)
        poses = se2.compose(robot.poses_at(times), planar(config.extrinsics))
        middle_s = start_s + 0.5 * config.sweep_s
        hits = scene.cast(_rays(poses, self.bearings), config.range_max_m, middle_s)
        ranges = self._mixed(hits.ranges_m, poses, scene, middle_s)
        ranges = ranges + config.bias_m + self._noise(ranges, hits.cosines)
        ranges = self._with_dust(ranges)
        ranges = np.where(self._lost(hits), np.inf, ranges)
        if config.resolution_m:
            ranges = np.round(ranges / config.resolution_m) * config.resolution_m
        return np.where(ranges >= config.range_max_m, np.inf, np.maximum(ranges, 0.0))

    def _mixed(self, ranges: Array, poses: Array, scene: Scene, time_s: float) -> Array:
        """Mixed pixels: readings between the two surfaces that a beam falls on."""
        config = self.config
        draw, weight = self._rng.random((2, config.beams))
        if not (config.mixing_probability and config.divergence_deg):
            return ranges
        half = 0.5 * math.radians(config.divergence_deg)
        both = np.concatenate([_rays(poses, self.bearings - half), _rays(poses, self.bearings + half)])
        borders = scene.cast(both, config.range_max_m, time_s).ranges_m.reshape(2, -1)
        near, far = borders.min(axis=0), borders.max(axis=0)
        # On a plane the central ray lies half-way between the border rays, however slanted; at an edge it lies on one of them.
        is_edge = np.abs(far + near - 2.0 * ranges) > 0.5 * (far - near)
        is_mixed = (
            is_edge
            & (far - near > config.mixing_gap_m)
            & (far < config.range_max_m)
            & (draw < config.mixing_probability)
        )
        return np.where(is_mixed, near + weight * (far - near), ranges)

    def _noise(self, ranges: Array, cosines: Array) -> Array:
        """Noise `(beams,)`: a mixture of two normal distributions, wider at long range and grazing incidence."""
        config = self.config
        normal, tail = self._rng.standard_normal(config.beams), self._rng.random(config.beams)
        factor = 1.0 + config.grazing_gain * (1.0 / np.maximum(cosines, 1e-3) - 1.0)
        sigma = (config.noise_m + config.noise_per_m * ranges) * np.minimum(factor, MAX_GRAZING_FACTOR)
        return np.asarray(sigma * np.where(tail < config.tail_fraction, config.tail_scale, 1.0) * normal)

    def _with_dust(self, ranges: Array) -> Array:
        """Outliers: readings of dust in the air, anywhere before the surface."""
        draw, where = self._rng.random((2, self.config.beams))
        return np.where(draw < self.config.outliers, where * ranges, ranges)

    def _lost(self, hits: Hits) -> NDArray[np.bool_]:
        """Mask `(beams,)` of beams without an echo: at random, and more often from dark surfaces at grazing incidence."""
        config = self.config
        grazing = config.grazing_dropout * (1.0 - hits.cosines) ** 4 * (1.0 - hits.reflectivity)
        return np.asarray(~hits.is_hit | (self._rng.random(config.beams) < config.dropout + grazing))

    def _message(self, stamp_ns: int, ranges: Array) -> LaserScan:
        config = self.config
        limits = as_float32(config.range_min_m), as_float32(config.range_max_m)
        values = readonly(ranges, np.float32)
        between_s = as_float32(self._between_s)
        return LaserScan(stamp_ns, config.frame, values, self._first, self._step, *limits, between_s)


def _rays(poses: Array, bearings: Array) -> Array:
    """Rays `(n, 4)` from poses `(n, 3)` at bearings `(n,)` relative to them."""
    yaw = poses[:, 2] + bearings
    return np.column_stack([poses[:, :2], np.cos(yaw), np.sin(yaw)])
