"""The final map: key scans drawn into one dense grid from their final poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.kernels import log_odds
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

UPDATE = log_odds.LogOddsUpdate(
    hit=0.9, miss=-0.4, limit=6.0
)  # two misses nearly cancel a hit; 7 hits saturate
MARGIN_M = 0.5  # around the scans
SHORTENED_BY_M = 0.1  # beams to masked endpoints end this far before them: range noise and unevenness
BYTES_PER_CELL = 12.0  # log-odds, number of the last update, probability


def draw_map(
    scans: Sequence[PreparedScan],
    poses: NDArray[np.float64],
    resolution_m: float,
    memory_limit_mb: float,
    masked: Sequence[NDArray[np.bool_]] | None = None,
) -> OccupancyGrid:
    """Occupancy grid of scans seen from their poses `(n, 3)`; its corner lies on a multiple of the cell size.

    `masked` holds one mask `(r,)` per scan over its returns: a masked return frees the cells along its beam and marks
    nothing at its endpoint.

    Raises MethodError if the grid would exceed the memory limit.
    """
    endpoints = [se2.transform_points(pose, scan.returns) for pose, scan in zip(poses, scans, strict=True)]
    origins = [
        se2.transform_points(pose, scan.viewpoint[None])[0] for pose, scan in zip(poses, scans, strict=True)
    ]
    if not endpoints:
        return OccupancyGrid(np.zeros((0, 0), np.float32), GridGeometry(resolution_m, (0.0, 0.0)))
    corners = np.concatenate([np.concatenate(endpoints), np.array(origins)])
    lo = np.floor((corners.min(axis=0) - MARGIN_M) / resolution_m).astype(np.int64)
    hi = np.ceil((corners.max(axis=0) + MARGIN_M) / resolution_m).astype(np.int64)
    cols, rows = (int(v) for v in hi - lo)
    if BYTES_PER_CELL * rows * cols > memory_limit_mb * 1e6:
        raise MethodError(
            f"the map would have {cols} x {rows} cells, more than method.memory_limit_mb = {memory_limit_mb:g} holds: "
            "the trajectory is wrong, or raise the limit, or coarsen method.map.resolution_m"
        )
    values = np.zeros((rows, cols), np.float32)
    last_update = np.zeros((rows, cols), np.int32)
    for number, (origin, points) in enumerate(zip(origins, endpoints, strict=True), start=1):
        is_hit = np.ones(len(points), np.bool_)
        if masked is not None:
            is_hit = ~masked[number - 1]
            points = _shortened(origin, points, ~is_hit)
        beams = log_odds.BeamBundle(origin / resolution_m - lo, points / resolution_m - lo)
        log_odds.insert_scan_dense(
            values, last_update, scan_number=number, beams=beams, is_hit=is_hit, update=UPDATE
        )
    probability = (1.0 / (1.0 + np.exp(-values))).astype(np.float32)
    probability[last_update == 0] = np.nan
    corner = (float(lo[0] * resolution_m), float(lo[1] * resolution_m))
    return OccupancyGrid(probability, GridGeometry(resolution_m, corner))


def _shortened(
    origin: NDArray[np.float64], endpoints: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """The endpoints `(m, 2)`, the chosen ones moved towards the origin (2,) by `SHORTENED_BY_M`."""
    beam = endpoints - origin
    length = np.maximum(np.hypot(beam[:, 0], beam[:, 1]), 1e-9)
    fraction = np.where(chosen, np.maximum(1.0 - SHORTENED_BY_M / length, 0.0), 1.0)
    return np.asarray(origin + beam * fraction[:, None])
