"""Finds lidars that are tilted, against their extrinsics, by the straight line on the floor that moves with the robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import quaternion_of_matrix, rotation_matrix
from gridslam.core.messages import LaserScan, Transform, readonly
from gridslam.core.trajectory import Trajectory
from gridslam.lidar_slam.sensor_checks.own_body import BeamLayout, beams_of, different_views_of

Floats = NDArray[np.float64]

YAW_STEP_RAD, MIN_TURNING_SCANS = 0.15, 20  # a rotation of 3 rad
MIN_VIEWS = 30  # smallest number of views that differ
# A beam meets the floor where it is never longer than this percentile of its readings, but for a few, and is often that long
FARTHEST_PERCENTILE, MAX_FARTHER, MIN_AT_FARTHEST = 96.0, 0.03, 0.15
TOLERANCE = 0.04  # relative: noise and an uneven floor
MIN_RANGE_M, MAX_RANGE_M = 1.2, 15.0  # nearer lines are the robot itself, and farther ones are met too rarely
MIN_HALF_ANGLE_RAD = 0.4  # half the angle that the line must fill
MIN_FILLED = 0.7  # smallest fraction of the beams in that angle that meet it
MAX_ANGLE_RAD = 1.3  # farther from the tilt's direction beams meet the floor too far away
MIN_SINE, MAX_SINE = 0.01, 0.5  # sines of tilts that correct the extrinsics
KEPT = 0.8  # fraction of the distance to the line; readings beyond may be the floor if the robot pitches a little
ITERATIONS = 5


@dataclass(frozen=True, slots=True)
class FloorLine:
    """The line on which one lidar meets the floor: `distance_m` from it at the bearing `bearing_rad` in its frame."""

    beams: BeamLayout
    distance_m: float
    bearing_rad: float

    def removed_from(self, scan: LaserScan) -> LaserScan:
        """The scan with NaN for readings near the line and beyond it; a scan with other beams unchanged."""
        beams, order = beams_of(scan)
        if beams != self.beams:
            return scan
        limits_m = KEPT * line_ranges(_bearings(beams), self.distance_m, self.bearing_rad)[order]
        is_floor = scan.ranges_m > limits_m
        if not is_floor.any():
            return scan
        return replace(scan, ranges_m=readonly(np.where(is_floor, np.nan, scan.ranges_m), np.float32))

    def applied_to_transform(self, transform: Transform) -> Transform:
        """The lidar's extrinsics with the tilt that follows from their height, if they have one; other transforms unchanged."""
        sine = transform.translation_m[2] / self.distance_m
        if transform.child_frame_id != self.beams.frame_id or not MIN_SINE < sine < MAX_SINE:
            return transform
        _, x, y, _ = transform.quat_wxyz
        is_upside_down = 1.0 - 2.0 * (x * x + y * y) < 0.0
        half_rad = 0.5 * math.asin(sine) * (-1.0 if is_upside_down else 1.0)
        cos, sin = math.cos(half_rad), math.sin(half_rad)
        tilt = (cos, -sin * math.sin(self.bearing_rad), sin * math.cos(self.bearing_rad), 0.0)
        tilted = rotation_matrix(transform.quat_wxyz) @ rotation_matrix(tilt)
        return replace(transform, quat_wxyz=quaternion_of_matrix(tilted))

    @property
    def note(self) -> str:
        """One line for the user."""
        return (
            f"{self.beams.frame_id} is tilted against its extrinsics: it meets the floor, or a ceiling, on a line "
            f"{self.distance_m:.1f} m away at {math.degrees(self.bearing_rad):.0f} deg that moves with the robot; returns from "
            f"there on are left out; set log.extrinsics.{self.beams.frame_id} with z, roll and pitch"
        )


def find_floor_lines(scans: Sequence[LaserScan], path: Callable[[], Trajectory]) -> list[FloorLine]:
    """The lines on which the lidars meet the floor, given scans of a robot that drives and turns; mostly none.

    `path` returns the robot's path over the scans; it is called only if there may be such a line.
    """
    found = []
    for beams, views in different_views_of(scans).items():
        line = _line(_bearings(beams), views) if len(views) >= MIN_VIEWS else None
        if line is not None:
            found.append(FloorLine(beams, *line))
    if not found:
        return []
    turning = _turning_scans(scans, path())
    return [line for line in found if _is_met_in(line, turning)]


def _turning_scans(scans: Sequence[LaserScan], path: Trajectory) -> list[LaserScan]:
    """The first scan after each YAW_STEP_RAD of rotation, back and forth."""
    if len(path) < 2:
        return []
    poses, _ = path.sorted().at(np.array([scan.stamp_ns for scan in scans], np.int64))
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(np.unwrap(poses[:, 2]))))])
    _, first = np.unique(turned // YAW_STEP_RAD, return_index=True)
    return [scans[row] for row in first.tolist()]


def _is_met_in(line: FloorLine, turning: Sequence[LaserScan]) -> bool:
    """Whether hardly any reading is beyond the line while the robot turns. Beyond a wall along the path, many readings are."""
    expected = line_ranges(_bearings(line.beams), line.distance_m, line.bearing_rad)
    is_inside = expected * math.cos(MIN_HALF_ANGLE_RAD) < line.distance_m
    farther = []
    for scan in turning:
        beams, order = beams_of(scan)
        if beams == line.beams:
            inside = is_inside[order]
            limits_m = (1.0 + TOLERANCE) * expected[order][inside]
            farther.append(np.mean(np.nan_to_num(scan.ranges_m[inside], posinf=0.0) > limits_m))
    return len(farther) >= MIN_TURNING_SCANS and float(np.mean(farther)) <= MAX_FARTHER


def line_ranges(bearings: Floats, distance_m: float, bearing_rad: float) -> Floats:
    """Range (m) `(n,)` of a line at the bearings `(n,)`; infinite where they are far from its direction."""
    apart = np.abs(np.remainder(bearings - bearing_rad + np.pi, 2.0 * np.pi) - np.pi)
    return np.where(apart < MAX_ANGLE_RAD, distance_m / np.cos(np.minimum(apart, MAX_ANGLE_RAD)), np.inf)


def _bearings(beams: BeamLayout) -> Floats:
    return np.asarray(beams.first_rad + beams.step_rad * np.arange(beams.number))


def _line(bearings: Floats, views: Floats) -> tuple[float, float] | None:
    """Distance (m) and bearing of the line that no reading of the views `(v, n)`, 0 for none, goes beyond; None without one."""
    readings = np.where(views > 0.0, views, np.nan)
    is_read = np.isfinite(readings).sum(axis=0) > 0.5 * len(views)
    farthest = np.full(len(bearings), np.inf)
    farthest[is_read] = np.nanpercentile(readings[:, is_read], FARTHEST_PERCENTILE, axis=0)
    at_farthest = (np.abs(views - farthest) < TOLERANCE * farthest).mean(axis=0)
    candidates = is_read & (at_farthest >= MIN_AT_FARTHEST) & (farthest > MIN_RANGE_M)
    axes = np.column_stack([np.cos(bearings), np.sin(bearings)])
    chosen = candidates
    for _ in range(ITERATIONS):
        if chosen.sum() < 3:
            return None
        # The inverse range of a line is linear in the beam's direction.
        normal, *_ = np.linalg.lstsq(axes[chosen], 1.0 / farthest[chosen], rcond=None)
        chosen = candidates & (np.abs(farthest * (axes @ normal) - 1.0) < TOLERANCE)
    distance_m, bearing_rad = 1.0 / math.hypot(*normal.tolist()), math.atan2(normal[1], normal[0])
    expected = line_ranges(bearings, distance_m, bearing_rad)
    is_inside = expected * math.cos(MIN_HALF_ANGLE_RAD) < distance_m
    if not MIN_RANGE_M < distance_m < MAX_RANGE_M or not is_inside.any():
        return None
    is_filled = chosen[is_inside].mean() >= MIN_FILLED
    farther = (views[:, is_inside] > (1.0 + TOLERANCE) * expected[is_inside]).mean()
    return (distance_m, bearing_rad) if is_filled and farther <= MAX_FARTHER else None
