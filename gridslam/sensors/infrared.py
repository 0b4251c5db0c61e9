"""Scans of infrared rangers on servos: reliability of the readings, and their end points."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RangeNoise:
    """Standard deviation of a reading: noise_m + noise_per_m2 * range^2 along the beam, `bearing_rad` * range across it."""

    noise_m: float = 0.004
    noise_per_m2: float = 0.015
    bearing_rad: float = 0.006

    def variances(self, ranges_m: Floats) -> tuple[Floats, Floats]:
        """Variances along and across the beams of readings `(n,)`."""
        return (self.noise_m + self.noise_per_m2 * ranges_m**2) ** 2, (self.bearing_rad * ranges_m) ** 2


@dataclass(frozen=True, slots=True)
class InfraredScan:
    """The samples of one stop (paper section 2.4), sensor by sensor, each sensor's in the order of measurement.

    `sensor` `(n,)` is the index of the sensor in `names` and `sensor_extrinsics`; `bearing_rad` `(n,)` is the servo's angle;
    `range_m` `(n,)` and its limits are as recorded.
    """

    stamp_ns: int
    names: tuple[str, ...]
    sensor_extrinsics: tuple[LidarExtrinsics, ...]
    sensor: NDArray[np.int64]
    bearing_rad: Floats
    range_m: Floats
    range_min_m: Floats
    range_max_m: Floats

    def __len__(self) -> int:
        return len(self.range_m)

    def is_valid(self) -> NDArray[np.bool_]:
        """L of section 2.5: strictly inside the valid range `(n,)`; NaN is not."""
        return np.asarray((self.range_m > self.range_min_m) & (self.range_m < self.range_max_m))

    def origins(self) -> Floats:
        """Origins of the beams, `(n, 2)` in the robot's frame."""
        return np.asarray(self._poses()[self.sensor, :2])

    def directions(self) -> Floats:
        """Headings of the beams `(n,)` in the robot's frame."""
        sign = np.array([-1.0 if m.flipped else 1.0 for m in self.sensor_extrinsics])
        return np.asarray(self._poses()[self.sensor, 2] + sign[self.sensor] * self.bearing_rad)

    def endpoints(self) -> Floats:
        """End points of the beams, `(n, 2)` in the robot's frame; not finite where the reading is not finite."""
        angle = self.directions()
        with np.errstate(invalid="ignore"):
            beams = self.range_m[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(self.origins() + beams)

    def _poses(self) -> Floats:
        return np.array([m.pose for m in self.sensor_extrinsics]).reshape(-1, 3)


def reliability(scan: InfraredScan, neighbour_m: float) -> Floats:
    """bel_k = L(l_k) D(l_{k-1}, l_k, l_{k+1}) `(n,)`, paper section 2.5.

    D is 1 if both neighbours differ by less than `neighbour_m` (m), 0 if neither does, else 0.5. The first and the last sample of
    a sweep have one neighbour, which counts twice; a single sample has none and gets 0.
    """
    n = len(scan)
    is_near_next = np.zeros(max(n - 1, 0), bool)
    paired = np.zeros(max(n - 1, 0), bool)
    if n > 1:
        with np.errstate(invalid="ignore"):
            is_near_next = np.abs(np.diff(scan.range_m)) < neighbour_m  # False beside NaN and infinity
        paired = scan.sensor[1:] == scan.sensor[:-1]
    with_next = np.r_[is_near_next & paired, False][:n]
    with_last = np.r_[False, is_near_next & paired][:n]
    has_next = np.r_[paired, False][:n]
    has_last = np.r_[False, paired][:n]
    count = has_next.astype(np.int64) + has_last
    density = (with_next.astype(np.float64) + with_last) / np.maximum(count, 1)
    return np.asarray(np.where(scan.is_valid(), density, 0.0))


@dataclass(frozen=True, slots=True)
class ReliableReadings:
    """The readings of a scan that are used.

    Origins, end points and unit directions `(n, 2)` in the robot's frame; range (m), reliability and index in the scan `(n,)`.
    """

    origins: Floats
    points: Floats
    directions: Floats
    ranges_m: Floats
    bel: Floats
    index: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.ranges_m)

    def variances(self, normals: Floats, noise: RangeNoise) -> Floats:
        """Variance `(n,)` of each end point along unit normals `(n, 2)` in the robot's frame."""
        along = np.sum(normals * self.directions, axis=1) ** 2
        radial, across = noise.variances(self.ranges_m)
        return np.asarray(along * radial + (1.0 - along) * across)

    def in_map(self, pose: Floats) -> Floats:
        """End points `(n, 2)` in the map, for T_map_base `(3,)`."""
        return se2.transform_points(pose, self.points)


def spacing_m(scans: Sequence[ReliableReadings]) -> float:
    """Median distance (m) between the end points of consecutive samples in several scans; NaN without any such pair."""
    distances = []
    for readings in scans:
        consecutive = np.diff(readings.index) == 1
        distances.append(np.hypot(*np.diff(readings.points, axis=0)[consecutive].T))
    together = np.concatenate([np.zeros(0), *distances])
    return float(np.median(together)) if len(together) else math.nan


def reliable_readings(scan: InfraredScan, bel: Floats) -> ReliableReadings:
    """The readings of a scan whose reliability `bel` `(n,)` is positive."""
    index = np.flatnonzero(bel > 0.0)
    angle = scan.directions()[index]
    return ReliableReadings(
        origins=scan.origins()[index],
        points=scan.endpoints()[index],
        directions=np.stack([np.cos(angle), np.sin(angle)], axis=1),
        ranges_m=scan.range_m[index],
        bel=bel[index],
        index=index,
    )
