"""What scans say of each other's points, one point and one beam at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.grids.free_space import Tolerances

Floats = NDArray[np.float64]


def verdict(
    point: Floats, pose: Floats, viewpoint: Floats, returns: Floats, sectors: int, limits: Tolerances
) -> int:
    """1 where a scan's returns `(m, 2)` show free space around a point of the map, -1 a surface at it, 0 neither."""
    x, y = se2.transform_points(se2.inverse(pose), point[None])[0] - viewpoint
    distance = float(np.hypot(x, y))
    if distance > limits.max_range_m:
        return 0
    tolerance = limits.floor_m + limits.per_m * distance
    rays = returns - viewpoint
    ranges = np.hypot(*rays.T)
    sector = sectors_of(rays, sectors)
    middle = int(sectors_of(np.array([[x, y]]), sectors)[0])
    beside = int(np.ceil(min(tolerance / distance, 0.5) / (2.0 * np.pi) * sectors))
    looked_at = [ranges[sector == (middle + k) % sectors] for k in range(-beside, beside + 1)]
    for found in looked_at:
        if len(found) and found.min() - tolerance <= distance <= found.max() + tolerance:
            return -1
    return int(all(len(found) > 0 and found.min() > distance + tolerance for found in looked_at))


def sectors_of(rays: Floats, sectors: int) -> NDArray[np.int64]:
    """The sector of every direction `(m, 2)`."""
    angle = np.arctan2(rays[:, 1], rays[:, 0]) / (2.0 * np.pi) + 1.0
    return np.floor(angle * sectors).astype(np.int64) % sectors
