"""Scans prepared for matching: points in the robot's frame with surface normals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.arrays import evenly_spaced, offsets_of
from gridslam.core.messages import LaserScan
from gridslam.kernels.grids.tiles import ScanSet
from gridslam.kernels.scan_matching.prepared_points import PointDensity, prepare_points
from gridslam.kernels.scan_matching.scan_points import RangeLimits
from gridslam.kernels.scan_matching.surfels import OrientedPoints
from gridslam.lidar_slam.config import ScanConfig
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]

DENSITY = PointDensity(
    spacing_m=0.03,  # closer points add no information and cost time in matching
    max_points=360,
    max_chord_m=2.0,  # gaps on one flat surface are filled up to this length
    chord_spacing_m=0.1,  # two points in a cell of the surface map
)


@dataclass(frozen=True, slots=True)
class PreparedScan:
    """A scan in the robot's frame at its stamp.

    `viewpoint` (2,) is the lidar's position. `returns` `(r, 2)` are the endpoints of all usable readings. `points` `(m, 2)`, a
    thinned subset, are for matching; `normals` `(m, 2)` are their unit normals, zero where unknown. `surface` `(s, 2)` with
    `surface_normals` is for insertion into maps: `points`, with gaps on flat surfaces filled.
    """

    stamp_ns: int
    viewpoint: Floats
    returns: Floats
    points: Floats
    normals: Floats
    surface: Floats
    surface_normals: Floats

    @property
    def matching_points(self) -> OrientedPoints:
        """All points used for matching."""
        return OrientedPoints(self.points, self.normals)

    @property
    def surface_points(self) -> OrientedPoints:
        """The points to be inserted into maps of surface elements."""
        return OrientedPoints(self.surface, self.surface_normals)

    def subset(self, max_points: int) -> OrientedPoints:
        """At most `max_points` of the points used for matching, distributed evenly over the scan."""
        chosen = evenly_spaced(len(self.points), max_points)
        return OrientedPoints(self.points[chosen], self.normals[chosen])


def scan_set(scans: Sequence[OrientedPoints]) -> ScanSet:
    """Many scans as one array, for kernels."""
    return ScanSet(
        np.concatenate([scan.points for scan in scans]),
        np.concatenate([scan.normals for scan in scans]),
        offsets_of(len(scan.points) for scan in scans),
    )


def prepare_scan(
    scan: LaserScan, extrinsics: LidarExtrinsics, twist: Floats, config: ScanConfig
) -> PreparedScan:
    """A scan as points with normals in the robot's frame.

    `twist` (vx, vy, wz) `(3,)` is the robot's velocity, by which its motion during the sweep is removed. Readings outside the
    limits of the sensor and of the config, NaN and infinities give no point.
    """
    sensor_max = scan.range_max_m if scan.range_max_m > 0.0 else np.inf
    limits = RangeLimits(max(config.min_range_m, scan.range_min_m), min(config.max_range_m, sensor_max))
    prepared = prepare_points(
        scan.ranges_m,
        extrinsics.sweep_of(scan),
        limits=limits,
        extrinsics=extrinsics.pose,
        twist=twist,
        density=DENSITY,
    )
    return PreparedScan(scan.stamp_ns, np.ascontiguousarray(extrinsics.pose[:2]), *prepared)
