"""From a scan as recorded to beams ready for a measurement model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan, Transform

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LidarExtrinsics:
    """How a lidar sits on the robot: `pose` is T_base_laser `(3,)`; a `flipped` one hangs upside down."""

    pose: Floats
    flipped: bool = False


@dataclass(frozen=True, slots=True)
class Beams:
    """The usable beams of one scan.

    `ranges` (m) and `bearings` (rad, about the vertical, in the frame of the extrinsics) `(n,)`; `returned` `(n,)` is False where
    nothing came back within the sensor's reach. `points` `(m, 2)` are the ends of the returned beams in the robot's frame.
    """

    ranges: Floats
    bearings: Floats
    returned: NDArray[np.bool_]
    points: Floats
    extrinsics: Floats
    reach_m: float
    unreadable: int  # NaN, negative, or below the least range

    def thinned(self, most: int) -> Beams:
        """At most so many beams, spread evenly over the scan; the points are those of the beams that are left."""
        n = len(self.ranges)
        if n <= most:
            return self
        chosen = (np.arange(most) * n) // most
        returned = self.returned[chosen]
        order = np.cumsum(self.returned) - 1
        points = self.points[order[chosen[returned]]]
        bearings = self.bearings[chosen]
        return Beams(
            self.ranges[chosen], bearings, returned, points, self.extrinsics, self.reach_m, self.unreadable
        )


def extrinsics_of(transform: Transform) -> LidarExtrinsics:
    """The planar extrinsics of a lidar from its static transform: x, y, yaw, and whether its z axis points down."""
    w, x, y, z = transform.quat_wxyz
    flipped = 1.0 - 2.0 * (x * x + y * y) < 0.0
    # The heading of the sensor's own x axis; Euler yaw would be half a turn off for some upside-down quaternions.
    yaw = float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return LidarExtrinsics(np.array([transform.translation_m[0], transform.translation_m[1], yaw]), flipped)


def beams_of(scan: LaserScan, extrinsics: LidarExtrinsics, min_range_m: float, max_range_m: float) -> Beams:
    """The beams of a scan, with readings below the least range and NaN left out.

    Readings at or beyond the reach (the smaller of `max_range_m` and the sensor's own), and infinities, are beams without return.
    """
    ranges: Floats = scan.ranges_m.astype(np.float64)
    angles: Floats = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(ranges), dtype=np.float64)
    if extrinsics.flipped:
        angles = -angles
    least = max(min_range_m, scan.range_min_m)
    reach = min(max_range_m, scan.range_max_m) if scan.range_max_m > 0.0 else max_range_m
    with np.errstate(invalid="ignore"):
        usable = ranges >= least
        returned = usable & (ranges < reach)
    bearings = angles[usable]
    lengths: Floats = np.minimum(ranges[usable], reach)
    back = returned[usable]
    ends = np.stack([np.cos(bearings[back]), np.sin(bearings[back])], axis=1) * lengths[back, None]
    points = se2.transform_points(extrinsics.pose, ends)
    return Beams(lengths, bearings, back, points, extrinsics.pose, reach, int(len(ranges) - usable.sum()))
