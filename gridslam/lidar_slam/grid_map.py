"""The finished map: key scans drawn into one dense grid from their final poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.kernels import log_odds
from gridslam.lidar_slam.config import MapConfig
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

MARGIN_M = 0.5
CLEAR_OF_OBJECTS_M = 0.1
BYTES_PER_CELL = 12.0  # log-odds, who touched it last, and the probability made of it


def draw_map(
    scans: Sequence[PreparedScan],
    poses: NDArray[np.float64],
    resolution_m: float,
    config: MapConfig,
    memory_limit_mb: float,
    explained: Sequence[NDArray[np.bool_]] | None = None,
) -> OccupancyGrid:
    """The occupancy grid of the scans seen from their poses `(n, 3)`; its corner lies on a multiple of the cell.

    Returns that something else explains (`explained`, one mask a scan) leave the space before them free, and nothing
    at their end.

    Raises MethodError when the grid would exceed the memory limit.
    """
    ends = [se2.transform_points(pose, scan.returns) for pose, scan in zip(poses, scans, strict=True)]
    eyes = [
        se2.transform_points(pose, scan.viewpoint[None])[0] for pose, scan in zip(poses, scans, strict=True)
    ]
    if not ends:
        return OccupancyGrid(np.zeros((0, 0), np.float32), GridGeometry(resolution_m, (0.0, 0.0)))
    corners = np.concatenate([np.concatenate(ends), np.array(eyes)])
    lo = np.floor((corners.min(axis=0) - MARGIN_M) / resolution_m).astype(np.int64)
    hi = np.ceil((corners.max(axis=0) + MARGIN_M) / resolution_m).astype(np.int64)
    cols, rows = (int(v) for v in hi - lo)
    if BYTES_PER_CELL * rows * cols > memory_limit_mb * 1e6:
        raise MethodError(
            f"the map would have {cols} x {rows} cells, more than method.memory_limit_mb = {memory_limit_mb:g} holds: "
            "either the trajectory has gone astray, or raise the limit or coarsen method.map.resolution_m"
        )
    values = np.zeros((rows, cols), np.float32)
    touched = np.zeros((rows, cols), np.int32)
    for number, (eye, end) in enumerate(zip(eyes, ends, strict=True), start=1):
        is_hit = np.ones(len(end), np.bool_)
        if explained is not None:
            is_hit = ~explained[number - 1]
            end = _shortened(eye, end, ~is_hit)
        log_odds.insert_scan_dense(
            values,
            touched,
            number,
            eye / resolution_m - lo,
            end / resolution_m - lo,
            is_hit,
            config.hit,
            config.miss,
            config.limit,
        )
    probability = (1.0 / (1.0 + np.exp(-values))).astype(np.float32)
    probability[touched == 0] = np.nan
    origin = (float(lo[0] * resolution_m), float(lo[1] * resolution_m))
    return OccupancyGrid(probability, GridGeometry(resolution_m, origin))


def _shortened(
    eye: NDArray[np.float64], ends: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """The ends `(m, 2)` with the chosen ones drawn back towards the eye (2,), clear of what they hit."""
    way = ends - eye
    length = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-9)
    share = np.where(chosen, np.maximum(1.0 - CLEAR_OF_OBJECTS_M / length, 0.0), 1.0)
    return np.asarray(eye + way * share[:, None])
