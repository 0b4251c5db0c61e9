"""A planar scan made of each point cloud: the nearest return by bearing within a band of heights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.cameras import rotation_matrix
from gridslam.core.messages import LaserScan, PointCloud, Transform, as_float32, readonly
from gridslam.logs.config import CloudConfig
from gridslam.logs.placement.levelling import Tilt
from gridslam.logs.rotations import IDENTITY

Floats = NDArray[np.float64]

BEAMS = 1440  # 0.25 degrees: finer than the columns of spinning lidars, so that hardly two share a beam
MIN_RANGE_M = 0.3  # nearer returns are the robot's own body
MAX_RANGE_M = 200.0
RAISED_M = 0.3  # a sensor at least so high above the base stands on the robot, and the base on the ground
GROUND_M, HEAD_M = 0.2, 1.8  # the band above the ground: no floor, no ceiling, no lintel
HALF_BAND_M = 0.3  # half height of the band about a sensor whose height is not known
# Times that leave the line through them by more of the sweep belong to no rotating sweep
LINEAR_FRACTION = 0.1
# About the median time of a cloud that no sweep has taken: a turning robot moves by 0.3 degrees
MIN_HALF_WINDOW_S = 0.005
# Depth (m) within which points of a beam are one surface with its nearest one: a minimum, plus a part that grows with the square
# of the range, as the noise of depth cameras does, and a maximum
NOISE_M, NOISE_PER_M, MAX_NOISE_M = 0.05, 0.008, 0.3
SECTOR_BEAMS, MIN_COVERED = 20, 0.9  # size of a sector, and how many of those with a return must be seen


@dataclass(frozen=True, slots=True)
class VirtualLidar:
    """Makes scans of one sensor's clouds.

    The scan's frame stands upright at the sensor's place in the base frame, with the base's axes. `rotation` `(3, 3)` and
    `translation_m` `(3,)` are T_base_sensor; heights are z in the base frame.
    """

    frame_id: str
    rotation: Floats
    translation_m: Floats
    min_height_m: float
    max_height_m: float
    tilt: Tilt | None = None  # of the robot, where its clouds are levelled

    def extrinsics(self, base_frame: str, stamp_ns: int) -> Transform:
        """T_base_scan as a static transform."""
        x, y, z = (float(v) for v in self.translation_m)
        return Transform(stamp_ns, base_frame, self.frame_id, (x, y, z), IDENTITY[1], is_static=True)

    def scan(self, cloud: PointCloud) -> LaserScan:
        """The scan of a cloud; beams without a return in the band are NaN, since nothing is known there."""
        given, rotation, height_m = cloud.points_m.astype(np.float64), self.rotation, self.translation_m[2]
        if self.tilt is not None:
            given, rotation = self._levelled(given @ self.rotation.T, cloud), np.eye(3)
        height = given @ rotation[2] + height_m
        used = np.flatnonzero((height >= self.min_height_m) & (height <= self.max_height_m))
        points = given[used] @ rotation[:2].T
        ranges = np.hypot(points[:, 0], points[:, 1])
        is_near = (ranges >= MIN_RANGE_M) & (ranges <= MAX_RANGE_M)
        used, points, ranges = used[is_near], points[is_near], ranges[is_near]
        bearings = np.arctan2(points[:, 1], points[:, 0])
        beams = ((bearings + math.pi) * (BEAMS / (2.0 * math.pi))).astype(np.int64) % BEAMS
        nearest, beam_of = _nearest_of_each(beams, ranges)
        increment = 2.0 * math.pi / BEAMS
        first, step, start_s, time_increment_s = 0, 1, 0.0, 0.0
        if len(cloud.times_s) and len(beam_of):
            times = cloud.times_s[used].astype(np.float64)
            first, step, start_s, time_increment_s = _sweep(beam_of, times[nearest])
            if not time_increment_s:
                around = _around_median(times, beams)
                start_s = float(np.median(times[around]))
                beams, ranges = beams[around], ranges[around]
                nearest, beam_of = _nearest_of_each(beams, ranges)
        values = _surface_ranges(beams, ranges, ranges[nearest], beam_of)
        order = (first + step * np.arange(BEAMS)) % BEAMS
        return LaserScan(
            cloud.stamp_ns + round(start_s * 1e9),
            self.frame_id,
            readonly(values[order], np.float32),
            angle_min_rad=as_float32(-math.pi + (first + 0.5) * increment),
            angle_increment_rad=as_float32(step * increment),
            range_min_m=as_float32(MIN_RANGE_M),
            range_max_m=as_float32(MAX_RANGE_M),
            time_increment_s=as_float32(time_increment_s),
            is_of_cloud=True,
        )

    def _levelled(self, points: Floats, cloud: PointCloud) -> Floats:
        """Points `(n, 3)` about the sensor along level axes, given along the base's; the tilt changes evenly with time."""
        assert self.tilt is not None
        times = cloud.times_s.astype(np.float64)
        ends = (float(times.min()), float(times.max())) if len(times) else (0.0, 0.0)
        first, last = (rotation_matrix(self.tilt.at(cloud.stamp_ns + round(time_s * 1e9))) for time_s in ends)
        levelled = points @ first.T
        if ends[1] > ends[0]:
            part = (times - ends[0]) / (ends[1] - ends[0])
            levelled += part[:, None] * (points @ (last - first).T)
        return np.asarray(levelled)


def virtual_lidar(
    frame: str, given: Transform, config: CloudConfig, tilt: Tilt | None = None
) -> VirtualLidar:
    """The virtual lidar of a sensor frame, whose extrinsics are `given`, on a robot that tilts or does not."""
    height = given.translation_m[2]
    if height >= RAISED_M:
        low, high = GROUND_M, max(HEAD_M, height + HALF_BAND_M)
    else:
        low, high = height - HALF_BAND_M, height + HALF_BAND_M
    return VirtualLidar(
        frame_id=f"{frame}_planar",
        rotation=rotation_matrix(given.quat_wxyz),
        translation_m=np.array(given.translation_m),
        min_height_m=low if config.min_height_m is None else config.min_height_m,
        max_height_m=high if config.max_height_m is None else config.max_height_m,
        tilt=tilt,
    )


def _nearest_of_each(beams: NDArray[np.int64], ranges: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the points that are nearest in their beams, and those beams."""
    smallest = np.full(BEAMS, np.inf)
    np.minimum.at(smallest, beams, ranges)
    candidates = np.flatnonzero(ranges == smallest[beams])
    beam_of, first = np.unique(beams[candidates], return_index=True)  # of equal ranges the first
    return candidates[first], beam_of


def _surface_ranges(
    beams: NDArray[np.int64], ranges: Floats, nearest_m: Floats, beam_of: NDArray[np.int64]
) -> Floats:
    """Range `(BEAMS,)` of the nearest surface: the mean of the points close behind the nearest, which noise has put too near.

    `nearest_m` are the smallest ranges of the beams `beam_of`; beams without points are NaN.
    """
    limits = np.full(BEAMS, np.nan)
    limits[beam_of] = nearest_m + np.minimum(NOISE_M + NOISE_PER_M * nearest_m**2, MAX_NOISE_M)
    close = ranges <= limits[beams]
    counts = np.bincount(beams[close], minlength=BEAMS)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.bincount(beams[close], ranges[close], BEAMS) / counts)


def _around_median(times: Floats, beams: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices of points whose times are close to the median, as few as see nearly all sectors that have a return.

    The nearest of returns that were taken while the robot turned is too near: they come from several directions.
    """
    apart = np.abs(times - np.median(times))
    sectors = beams // SECTOR_BEAMS
    covered = MIN_COVERED * len(np.unique(sectors))
    half_s = MIN_HALF_WINDOW_S
    while True:
        chosen = np.flatnonzero(apart <= half_s)
        if len(chosen) == len(times) or len(np.unique(sectors[chosen])) >= covered:
            return chosen
        half_s *= 2.0


def _sweep(beam_of: NDArray[np.int64], times: Floats) -> tuple[int, int, float, float]:
    """The first beam of a rotating sweep, its sense (1 or -1), its start (s) and the time between beams (s).

    Where times do not follow the bearing (solid-state lidars), the time between beams is 0.
    """
    unknown = 0, 1, float(np.median(times)), 0.0
    duration = float(times.max() - times.min())
    if duration <= 0.0:
        return unknown
    first = int(beam_of[np.argmin(times)])
    for step in (1, -1):
        place = (step * (beam_of - first)) % BEAMS
        # Neighbours of the first beam may lie on either side of the seam.
        near_seam = (place > 0.95 * BEAMS) & (times < times.min() + 0.5 * duration)
        place = np.where(near_seam, place - BEAMS, place)
        increment, start = np.polyfit(place, times, 1)
        if increment > 0.0 and np.abs(start + increment * place - times).max() < LINEAR_FRACTION * duration:
            return first, step, float(start), float(increment)
    return unknown
