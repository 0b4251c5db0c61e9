"""Ranges out of depth images: per column the nearest point in a height band, as a planar lidar would report it.

So a depth camera on the robot gives the ranges of ispace-mcl's onboard weight (eqs. 3 and 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import DepthImage, LaserScan, readonly
from gridslam.sensors.fixed_camera import Pinhole
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]

_COLUMNS_PER_BEAM = 2  # a beam is wider than any column, so that none stays empty
_ROW_STEP = 2


@dataclass(frozen=True, slots=True)
class DepthBand:
    """Which depths are walls: heights above the floor from `low_m` to `high_m`, and nothing farther away than `reach_m`."""

    low_m: float
    high_m: float
    reach_m: float


def planar_extrinsics(pinhole: Pinhole) -> LidarExtrinsics:
    """Where the camera sits in the robot's plane, and where it looks (its axis, seen from above)."""
    forward = pinhole.rotation[:, 2]
    yaw = float(np.arctan2(forward[1], forward[0]))
    return LidarExtrinsics(np.array([pinhole.position[0], pinhole.position[1], yaw]))


def depth_scan(depth: DepthImage, pinhole: Pinhole, band: DepthBand) -> LaserScan:
    """The scan that a depth image `(rows, cols)` stands for; `pinhole` is T_base_optical with the base on the floor.

    Bearings count from the camera's axis, seen from above. A beam is infinite where all that it meets in the band is beyond the
    reach, and NaN where there is nothing at all: no depth, or only floor and ceiling.
    """
    rows, cols = (n.ravel() for n in np.mgrid[: depth.depth_m.shape[0] : _ROW_STEP, : depth.depth_m.shape[1]])
    depths = depth.depth_m[rows, cols].astype(np.float64)
    known = np.isfinite(depths) & (depths > 0.0)
    points = pinhole.to_map(rows[known], cols[known], depths[known])
    points = points[(points[:, 2] > band.low_m) & (points[:, 2] < band.high_m)]
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
    nearest[nearest >= band.reach_m] = np.inf
    nearest[is_empty] = np.nan
    return LaserScan(
        depth.stamp_ns,
        ranges_frame(depth.frame_id),
        readonly(nearest, np.float32),
        -half,
        step,
        0.0,
        band.reach_m,
    )


def ranges_frame(camera_frame: str) -> str:
    """The frame of the scans that are made of a camera's depths."""
    return f"{camera_frame} ranges"


def _half_view(pinhole: Pinhole, cols: int) -> float:
    """The angle between the axis and the farther edge of the image."""
    edge = max(pinhole.centre_px[0], cols - 1 - pinhole.centre_px[0])
    return float(np.arctan2(edge, pinhole.focal_px[0]))
