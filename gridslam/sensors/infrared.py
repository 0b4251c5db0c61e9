"""Scans of infrared rangers that servos sweep: which readings are to be trusted, and where they end."""

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
    """Deviation of a reading: noise_m + noise_per_m2 * range^2 along the beam, `bearing_rad` * range across it."""

    noise_m: float = 0.004
    noise_per_m2: float = 0.015
    bearing_rad: float = 0.006

    def variances(self, ranges_m: Floats) -> tuple[Floats, Floats]:
        """Variances along and across the beams of readings `(n,)`."""
        return (self.noise_m + self.noise_per_m2 * ranges_m**2) ** 2, (self.bearing_rad * ranges_m) ** 2


@dataclass(frozen=True, slots=True)
class InfraredScan:
    """The samples of one stop (paper section 2.4), sensor after sensor, each sensor's in the order in which they were taken.

    `sensor` `(n,)` counts the `names`; `bearing_rad` is the servo's angle; `range_m` and its limits are as recorded.
    `sensor_extrinsics`
    are those of the sensors.
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
        """Where the beams begin, `(n, 2)` in the robot's frame."""
        return np.asarray(self._poses()[self.sensor, :2])

    def directions(self) -> Floats:
        """Headings of the beams `(n,)` in the robot's frame."""
        sense = np.array([-1.0 if m.flipped else 1.0 for m in self.sensor_extrinsics])
        return np.asarray(self._poses()[self.sensor, 2] + sense[self.sensor] * self.bearing_rad)

    def ends(self) -> Floats:
        """Where the readings end, `(n, 2)` in the robot's frame; not finite where the reading is not."""
        angle = self.directions()
        with np.errstate(invalid="ignore"):
            steps = self.range_m[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.asarray(self.origins() + steps)

    def _poses(self) -> Floats:
        return np.array([m.pose for m in self.sensor_extrinsics]).reshape(-1, 3)


def reliability(scan: InfraredScan, neighbour_m: float) -> Floats:
    """bel_k = L(l_k) D(l_{k-1}, l_k, l_{k+1}) `(n,)`, paper section 2.5.

    D is 1 if both neighbours differ by less than `neighbour_m`, 0 if both differ by more (or as much), else 0.5. The first
    and the last sample of a sweep have one neighbour, which counts for both; a single sample has none and is not trusted.
    """
    n = len(scan)
    agrees = np.zeros(max(n - 1, 0), bool)
    paired = np.zeros(max(n - 1, 0), bool)
    if n > 1:
        with np.errstate(invalid="ignore"):
            agrees = np.abs(np.diff(scan.range_m)) < neighbour_m  # False beside NaN and infinity
        paired = scan.sensor[1:] == scan.sensor[:-1]
    with_next = np.r_[agrees & paired, False][:n]
    with_last = np.r_[False, agrees & paired][:n]
    has_next = np.r_[paired, False][:n]
    has_last = np.r_[False, paired][:n]
    count = has_next.astype(np.int64) + has_last
    density = (with_next.astype(np.float64) + with_last) / np.maximum(count, 1)
    return np.asarray(np.where(scan.is_valid(), density, 0.0))


@dataclass(frozen=True, slots=True)
class BeamEnds:
    """Readings that are used: origins, end points and unit directions `(n, 2)` in the robot's frame; range, bel and index in
    the scan `(n,)`.
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
        """End points `(n, 2)` seen from a pose `(3,)`."""
        return se2.transform_points(pose, self.points)


def spacing_m(ends: Sequence[BeamEnds]) -> float:
    """How far apart the end points of neighbouring samples are in the median of several scans (m); NaN where there are none."""
    apart = []
    for scan in ends:
        beside = np.diff(scan.index) == 1
        apart.append(np.hypot(*np.diff(scan.points, axis=0)[beside].T))
    together = np.concatenate([np.zeros(0), *apart])
    return float(np.median(together)) if len(together) else math.nan


def reliable_ends(scan: InfraredScan, bel: Floats) -> BeamEnds:
    """The readings with bel > 0."""
    index = np.flatnonzero(bel > 0.0)
    angle = scan.directions()[index]
    return BeamEnds(
        scan.origins()[index],
        scan.ends()[index],
        np.stack([np.cos(angle), np.sin(angle)], axis=1),
        scan.range_m[index],
        bel[index],
        index,
    )
