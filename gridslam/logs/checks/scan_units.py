"""Converts scans whose angles are in degrees, or whose readings are in millimetres or centimetres, to radians and metres."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gridslam.core.messages import LaserScan, PointCloud, as_float32, readonly
from gridslam.logs.message_counts import MessageCounts

MAX_SWEEP_RAD = 2.0 * math.pi * 1.05  # largest angle of a sweep: a circle and 5 %
MIN_SWEEP_RAD = 0.1  # a lidar that says degrees sees more than this
MAX_RANGE_M = 1000.0  # larger than the range of any planar lidar
MAX_MEDIAN_M = 100.0  # largest median of readings: beyond it, and beyond any limit, they are not metres
NEAR_M, FAR_M = 0.6, 100.0  # medians of readings in rooms and halls
MIN_POINTS = 100  # smallest number of points of a cloud that shows its unit
UNITS = (("mm", 1000.0), ("cm", 100.0))


def in_radians(scan: LaserScan) -> LaserScan:
    """The scan with its angles as radians, if they can only be degrees; else the same object."""
    intervals = len(scan.ranges_m) - 1
    sweep = abs(scan.angle_increment_rad) * intervals
    if intervals < 1 or not math.isfinite(sweep) or sweep <= MAX_SWEEP_RAD:
        return scan
    if not MIN_SWEEP_RAD < math.radians(sweep) <= MAX_SWEEP_RAD or abs(scan.angle_min_rad) > 360.0:
        return scan
    first, last = (
        value if abs(value) <= MAX_SWEEP_RAD else math.radians(value)  # some state the limits right
        for value in (scan.angle_min_rad, scan.angle_max_rad)
    )
    return replace(
        scan,
        angle_min_rad=as_float32(first),
        angle_max_rad=last,
        angle_increment_rad=as_float32(math.radians(scan.angle_increment_rad)),
    )


def range_unit(scans: Sequence[LaserScan]) -> tuple[str, float] | None:
    """The unit of the readings of a stream's first scans, and their number in a metre; None if they are metres."""
    if not scans:
        return None
    readings = np.concatenate([scan.ranges_m for scan in scans])
    readings = readings[np.isfinite(readings) & (readings > 0.0)]
    limit = scans[0].range_max_m
    middle = float(np.median(readings)) if len(readings) else 0.0
    return None if middle < limit < MAX_RANGE_M else _unit_of(middle)


def _unit_of(middle: float) -> tuple[str, float] | None:
    if middle <= MAX_MEDIAN_M:
        return None
    return next((unit for unit in UNITS if NEAR_M <= middle / unit[1] <= FAR_M), None)


def in_metres(scan: LaserScan, per_metre: float) -> LaserScan:
    """The scan with readings of which `per_metre` are a metre, as metres; limits beyond any lidar are of that unit too."""
    limits_too = not scan.range_max_m < MAX_RANGE_M and math.isfinite(scan.range_max_m)
    factor = 1.0 / per_metre if limits_too else 1.0
    return replace(
        scan,
        ranges_m=readonly(scan.ranges_m / np.float32(per_metre), np.float32),
        range_min_m=as_float32(scan.range_min_m * factor),
        range_max_m=as_float32(scan.range_max_m * factor),
    )


class CloudUnits:
    """Converts the points of one stream to metres; the first cloud with enough points shows their unit."""

    def __init__(self, label: str, message_counts: MessageCounts) -> None:
        self._label = label
        self._message_counts = message_counts
        self._per_metre: float | None = None

    def repaired(self, cloud: PointCloud) -> PointCloud:
        """The cloud in metres; the same object if it already is."""
        if self._per_metre is None:
            if len(cloud.points_m) < MIN_POINTS:
                return cloud
            unit = _unit_of(float(np.median(np.linalg.norm(cloud.points_m, axis=1))))
            self._per_metre = 1.0 if unit is None else unit[1]
            if unit is not None:
                self._message_counts.find(
                    f"{self._label}: points are in {unit[0]}, not in m: divided by {unit[1]:g}"
                )
        if self._per_metre == 1.0:
            return cloud
        self._message_counts.count("repaired.cloud.unit")
        return replace(cloud, points_m=readonly(cloud.points_m / np.float32(self._per_metre), np.float32))
