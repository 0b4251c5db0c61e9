"""Conversion of depth images to planar scans: for each bearing the nearest point within a height band.

A depth camera on the robot then gives the ranges of ispace-mcl's onboard weight (eqs. 3 and 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import DepthImage, LaserScan, readonly
from gridslam.sensors.lidar_beams import LidarExtrinsics
from gridslam.sensors.pinhole import Pinhole

Floats = NDArray[np.float64]

_COLUMNS_PER_BEAM = 2  # a beam is wider than every image column, so that no beam is without points
_ROW_STEP = 2  # every second row, for speed


@dataclass(frozen=True, slots=True)
class DepthBand:
    """The points that count as walls: their heights above the floor, m, and their largest range, m."""

    min_height_m: float
    max_height_m: float
    max_range_m: float


def planar_extrinsics(pinhole: Pinhole) -> LidarExtrinsics:
    """The camera's position in the robot's plane and the heading of its optical axis."""
    forward = pinhole.rotation[:, 2]
    yaw = float(np.arctan2(forward[1], forward[0]))
    return LidarExtrinsics(np.array([pinhole.position[0], pinhole.position[1], yaw]))


def depth_scan(depth: DepthImage, pinhole: Pinhole, band: DepthBand) -> LaserScan:
    """The planar scan of a depth image `(rows, cols)`; `pinhole` is T_base_optical with the base frame on the floor.

    Bearings are relative to the heading of the optical axis. A range is infinite if all points of the band are beyond the maximum
    range, and NaN if there is no point in the band: no depth, or only floor and ceiling.
    """
    rows, cols = (n.ravel() for n in np.mgrid[: depth.depth_m.shape[0] : _ROW_STEP, : depth.depth_m.shape[1]])
    depths = depth.depth_m[rows, cols].astype(np.float64)
    known = np.isfinite(depths) & (depths > 0.0)
    points = pinhole.to_map(rows[known], cols[known], depths[known])
    points = points[(points[:, 2] > band.min_height_m) & (points[:, 2] < band.max_height_m)]
    extrinsics = planar_extrinsics(pinhole).pose
    off = points[:, :2] - extrinsics[:2]
    bearings = np.arctan2(off[:, 1], off[:, 0]) - extrinsics[2]
    bearings -= 2.0 * np.pi * np.rint(bearings / (2.0 * np.pi))
    half = _half_view(pinhole, depth.depth_m.shape[1])
    beams = max(depth.depth_m.shape[1] // _COLUMNS_PER_BEAM, 2)
    step = 2.0 * half / (beams - 1)
    index = np.rint((bearings + half) / step).astype(np.int64)
    inside = (index >= 0) & (index < beams)
    nearest = np.full(beams, np.inf)
    np.minimum.at(nearest, index[inside], np.hypot(off[inside, 0], off[inside, 1]))
    is_empty = np.isinf(nearest)
    nearest[nearest >= band.max_range_m] = np.inf
    nearest[is_empty] = np.nan
    return LaserScan(
        stamp_ns=depth.stamp_ns,
        frame_id=ranges_frame(depth.frame_id),
        ranges_m=readonly(nearest, np.float32),
        angle_min_rad=-half,
        angle_increment_rad=step,
        range_min_m=0.0,
        range_max_m=band.max_range_m,
    )


def ranges_frame(camera_frame: str) -> str:
    """The frame id of the scans made from a camera's depth images."""
    return f"{camera_frame} ranges"


def _half_view(pinhole: Pinhole, cols: int) -> float:
    """The angle (rad) between the optical axis and the farther edge of the image."""
    edge = max(pinhole.centre_px[0], cols - 1 - pinhole.centre_px[0])
    return float(np.arctan2(edge, pinhole.focal_px[0]))
