"""Scans from known poses in the ring of corridors, prepared for matching."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.messages import LaserScan
from gridslam.lidar_slam.config import ScanConfig
from gridslam.lidar_slam.scans import PreparedScan, prepare_scan
from gridslam.sensors.lidar_beams import LidarExtrinsics
from tests.methods.slam_sd import hall

Floats = NDArray[np.float64]

ANGLES = np.linspace(-np.pi, np.pi, 360, endpoint=False)
NOISE_M = 0.01


def scan_at(pose: Floats, index: int = 0, max_range_m: float = 30.0) -> PreparedScan:
    """The scan of a lidar at a true pose `(3,)`; with a maximal range of 0.1 m it is empty."""
    rng = np.random.default_rng(index)
    ranges = hall.ranges_from(pose, ANGLES) + rng.normal(0.0, NOISE_M, len(ANGLES))
    scan = LaserScan(
        10**9 + index * hall.PERIOD_NS,
        "laser",
        angle_min_rad=float(ANGLES[0]),
        angle_increment_rad=float(ANGLES[1] - ANGLES[0]),
        range_min_m=0.05,
        range_max_m=max_range_m,
        ranges_m=ranges.astype(np.float32),
    )
    return prepare_scan(scan, LidarExtrinsics(np.zeros(3)), np.zeros(3), ScanConfig())
