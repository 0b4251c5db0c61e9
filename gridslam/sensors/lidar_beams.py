"""Conversion of a recorded scan to beams that the measurement models take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.arrays import evenly_spaced
from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import LaserScan, Transform
from gridslam.kernels.scan_matching.scan_points import LEVEL, Projection, Sweep

Floats = NDArray[np.float64]

LEVEL_TOLERANCE = 2e-5  # tolerance of the projection: a lidar tilted by 0.3 degrees is level


@dataclass(frozen=True, slots=True)
class LidarExtrinsics:
    """The lidar's pose on the robot: `pose` is T_base_laser `(3,)`; `flipped` is True for a lidar mounted upside down.

    `projection` maps points of the sensor's plane (with y reversed if it is flipped) to the horizontal plane.
    """

    pose: Floats
    flipped: bool = False
    projection: Projection = LEVEL

    def sweep_of(self, scan: LaserScan) -> Sweep:
        """The angles, times and projection of a scan's beams."""
        sign = -1.0 if self.flipped else 1.0
        first, step = sign * scan.angle_min_rad, sign * scan.angle_increment_rad
        return Sweep(first, step, scan.time_increment_s, self.projection)


@dataclass(frozen=True, slots=True)
class Beams:
    """The usable beams of one scan.

    `ranges` (m) and `bearings` (rad, about the vertical, in the frame of the extrinsics) are `(n,)`; `returned` `(n,)` is False
    for beams without return within `max_range_m`. `points` `(m, 2)` are the endpoints of the returned beams in the robot's frame.
    `extrinsics` is T_base_laser `(3,)`.
    """

    ranges: Floats
    bearings: Floats
    returned: NDArray[np.bool_]
    points: Floats
    extrinsics: Floats
    max_range_m: float
    unreadable: int  # number of readings that are NaN, negative, or below the minimum range

    def subsampled(self, max_beams: int) -> Beams:
        """At most `max_beams` of the beams, evenly from the scan, with the endpoints of those."""
        n = len(self.ranges)
        if n <= max_beams:
            return self
        chosen = evenly_spaced(n, max_beams)
        returned = self.returned[chosen]
        order = np.cumsum(self.returned) - 1
        return Beams(
            ranges=self.ranges[chosen],
            bearings=self.bearings[chosen],
            returned=returned,
            points=self.points[order[chosen[returned]]],
            extrinsics=self.extrinsics,
            max_range_m=self.max_range_m,
            unreadable=self.unreadable,
        )


def extrinsics_of(transform: Transform) -> LidarExtrinsics:
    """The planar extrinsics of a lidar: x, y and yaw of its static transform, whether its z axis points down, and its tilt."""
    w, x, y, z = transform.quat_wxyz
    flipped = 1.0 - 2.0 * (x * x + y * y) < 0.0
    # The heading of the sensor's own x axis; Euler yaw would be off by pi for some upside-down quaternions.
    yaw = float(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    pose = np.array([transform.translation_m[0], transform.translation_m[1], yaw])
    return LidarExtrinsics(pose, flipped, _projection(rotation_matrix((w, x, y, z)), yaw, flipped))


def _projection(rotation: Floats, yaw: float, flipped: bool) -> Projection:
    """Projection of the plane of a lidar with this rotation `(3, 3)` onto the horizontal, without its yaw."""
    x_axis, y_axis = rotation[:2, 0], rotation[:2, 1] * (-1.0 if flipped else 1.0)
    c, s = np.cos(yaw), np.sin(yaw)
    found = Projection(
        float(np.hypot(*x_axis)), float(c * y_axis[0] + s * y_axis[1]), float(c * y_axis[1] - s * y_axis[0])
    )
    is_level = max(abs(a - b) for a, b in zip(found, LEVEL, strict=True)) < LEVEL_TOLERANCE
    return LEVEL if is_level else found


def beams_of(scan: LaserScan, extrinsics: LidarExtrinsics, min_range_m: float, max_range_m: float) -> Beams:
    """The beams of a scan without NaN readings and without readings below the minimum range.

    The maximum range is the smaller of `max_range_m` and the sensor's own. Readings at or beyond it, and infinite ones, are beams
    without return.
    """
    ranges: Floats = scan.ranges_m.astype(np.float64)
    angles: Floats = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(ranges), dtype=np.float64)
    if extrinsics.flipped:
        angles = -angles
    shortest = max(min_range_m, scan.range_min_m)
    longest = min(max_range_m, scan.range_max_m) if scan.range_max_m > 0.0 else max_range_m
    with np.errstate(invalid="ignore"):
        usable = ranges >= shortest
        returned = usable & (ranges < longest)
    bearings = angles[usable]
    lengths: Floats = np.minimum(ranges[usable], longest)
    if extrinsics.projection != LEVEL:
        bearings, lengths = _projected(bearings, lengths, extrinsics.projection)
    has_return = returned[usable]
    directions = np.stack([np.cos(bearings[has_return]), np.sin(bearings[has_return])], axis=1)
    endpoints = directions * lengths[has_return, None]
    return Beams(
        ranges=lengths,
        bearings=bearings,
        returned=has_return,
        points=se2.transform_points(extrinsics.pose, endpoints),
        extrinsics=extrinsics.pose,
        max_range_m=longest,
        unreadable=int(len(ranges) - usable.sum()),
    )


def _projected(bearings: Floats, lengths: Floats, projection: Projection) -> tuple[Floats, Floats]:
    """Bearings and lengths `(n,)` of beams in the horizontal plane, given those in the sensor's."""
    x, y = lengths * np.cos(bearings), lengths * np.sin(bearings)
    x, y = projection.x_per_x * x + projection.x_per_y * y, projection.y_per_y * y
    return np.arctan2(y, x), np.hypot(x, y)
