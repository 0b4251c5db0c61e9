"""Scans made ready for matching."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan
from gridslam.kernels import scan_points
from gridslam.lidar_slam.config import ScanConfig
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PreparedScan:
    """All returned points `(m, 2)` in the robot's frame, and the thinned subset with normals used for matching."""

    stamp_ns: int
    viewpoint: Floats  # the lidar's position in the robot's frame (2,)
    returns: Floats
    points: Floats
    normals: Floats
    surface: Floats  # points along the surfaces between the returns as well, to be inserted
    surface_normals: Floats

    def subset(self, max_points: int) -> tuple[Floats, Floats]:
        """At most `max_points` of the points with their normals, spread evenly over the scan."""
        if len(self.points) <= max_points:
            return self.points, self.normals
        chosen = (np.arange(max_points) * len(self.points)) // max_points
        return self.points[chosen], self.normals[chosen]


def prepare_scan(
    scan: LaserScan, extrinsics: LidarExtrinsics, twist: Floats, config: ScanConfig
) -> PreparedScan:
    """Points of the robot's frame with normals; `twist` (vx, vy, wz) `(3,)` undoes the robot's motion during the sweep.

    Readings outside the limits of the sensor and of the config, NaN and infinities give no point.
    """
    sign = -1.0 if extrinsics.flipped else 1.0
    sensor_max = scan.range_max_m if scan.range_max_m > 0.0 else np.inf
    points, beams = scan_points.scan_to_points(
        scan.ranges_m,
        sign * scan.angle_min_rad,
        sign * scan.angle_increment_rad,
        max(config.min_range_m, scan.range_min_m),
        min(config.max_range_m, sensor_max),
        extrinsics.pose,
        twist,
        scan.time_increment_s,
    )
    viewpoint = np.ascontiguousarray(extrinsics.pose[:2])
    normals = scan_points.surface_normals(points, beams, viewpoint)
    kept = scan_points.thin_out(points, config.spacing_m, config.max_points)
    thin, thin_normals = points[kept], normals[kept]
    chords = scan_points.surface_chords(thin, thin_normals, config.max_chord_m)
    surface, surface_normals = scan_points.fill_chords(thin, thin_normals, chords, config.chord_spacing_m)
    return PreparedScan(scan.stamp_ns, viewpoint, points, thin, thin_normals, surface, surface_normals)
