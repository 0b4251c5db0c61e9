"""The reliable readings of all stops in common arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.ir_scan.stops import Stop
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class StackedReadings:
    """The n reliable readings of all stops.

    Index of the stop `(n,)`, end points (m) and unit directions `(n, 2)` in the robot's frame, ranges (m) and reliability `(n,)`.
    """

    stop: Ints
    points: Floats
    directions: Floats
    ranges_m: Floats
    bel: Floats

    @staticmethod
    def of(stops: Sequence[Stop]) -> StackedReadings:
        """Stacked readings of all stops that have a scan, in order."""
        scans = [(k, stop.readings) for k, stop in enumerate(stops) if stop.readings is not None]
        return StackedReadings(
            np.concatenate([np.zeros(0, np.int64), *(np.full(len(readings), k) for k, readings in scans)]),
            np.concatenate([np.zeros((0, 2)), *(readings.points for _, readings in scans)]),
            np.concatenate([np.zeros((0, 2)), *(readings.directions for _, readings in scans)]),
            np.concatenate([np.zeros(0), *(readings.ranges_m for _, readings in scans)]),
            np.concatenate([np.zeros(0), *(readings.bel for _, readings in scans)]),
        )

    def in_map(self, poses: Floats) -> Floats:
        """End points `(n, 2)` (m) in the map, at the `poses` `(s, 3)` of the stops."""
        return rotated(self.points, poses[self.stop, 2]) + poses[self.stop, :2]

    def variances(self, normals: Floats, poses: Floats, noise: RangeNoise) -> Floats:
        """Variances (m^2) `(n,)` of the end points along `normals` `(n, 2)` in the map, at the `poses` `(s, 3)` of the stops."""
        along = np.sum(normals * rotated(self.directions, poses[self.stop, 2]), axis=1) ** 2
        radial, across = noise.variances(self.ranges_m)
        return np.asarray(along * radial + (1.0 - along) * across)


def rotated(vectors: Floats, angles: Floats) -> Floats:
    """Vectors `(n, 2)`, each rotated by its angle `(n,)`."""
    c, s = np.cos(angles), np.sin(angles)
    return np.stack([c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]], axis=1)
