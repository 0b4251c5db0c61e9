"""The final map: key scans drawn into one dense grid from their final poses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.errors import MethodError
from gridslam.core.memory import system_zeros
from gridslam.kernels.grids import log_odds
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid

# Two misses nearly cancel a hit; 7 hits saturate
UPDATE = log_odds.LogOddsUpdate(hit=0.9, miss=-0.4, limit=6.0)
MARGIN_M = 0.5  # width of the border around the scans
SHORTENED_BY_M = 0.1  # beams to masked endpoints end this far before them: range noise and unevenness
BYTES_PER_CELL = 5.0  # log-odds, which become the probability, and the number of the last update


class LastUpdates:
    """Number of the scan that changed each cell of a grid last, in one byte a cell.

    Scans are numbered from 1 to 255, then the numbers are cleared and start again.
    """

    def __init__(self, rows: int, cols: int) -> None:
        self._shape = rows, cols
        self._start_again()

    def next_scan(self) -> int:
        """The number of one more scan; no cell has it yet."""
        if self._number == np.iinfo(np.uint8).max:
            self._start_again()
        self._number += 1
        return self._number

    def _start_again(self) -> None:
        rows, cols = self._shape
        self.numbers = system_zeros(rows * cols, np.uint8).reshape(rows, cols)
        self._number = 0


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
    if not len(scans):
        return OccupancyGrid(np.zeros((0, 0), np.float32), GridGeometry(resolution_m, (0.0, 0.0)))
    bounds = np.concatenate([_bounds(scan, pose) for scan, pose in zip(scans, poses, strict=True)])
    lo, rows, cols = grid_extent(bounds, resolution_m, memory_limit_mb, BYTES_PER_CELL)
    values = np.full((rows, cols), np.nan, np.float32)
    last = LastUpdates(rows, cols)
    for number, (scan, pose) in enumerate(zip(scans, poses, strict=True)):
        points = se2.transform_points(pose, scan.returns)
        origin = se2.transform_points(pose, scan.viewpoint[None])[0]
        is_hit = np.ones(len(points), np.bool_)
        if masked is not None:
            is_hit = ~masked[number]
            points = _shortened(origin, points, ~is_hit)
        beams = log_odds.BeamBundle(origin / resolution_m - lo, points / resolution_m - lo)
        log_odds.insert_scan_dense(
            values, last.numbers, scan_number=last.next_scan(), beams=beams, is_hit=is_hit, update=UPDATE
        )
    corner = (float(lo[0] * resolution_m), float(lo[1] * resolution_m))
    return OccupancyGrid(to_probability(values), GridGeometry(resolution_m, corner))


def _bounds(scan: PreparedScan, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """The smallest and the largest x, y `(2, 2)` of a scan's endpoints and viewpoint in the map frame."""
    points = se2.transform_points(pose, np.vstack([scan.returns, scan.viewpoint]))
    return np.stack([points.min(axis=0), points.max(axis=0)])


def to_probability(log_odds: NDArray[np.float32]) -> NDArray[np.float32]:
    """Probabilities 1 / (1 + exp(-log_odds)) `(rows, cols)`, written over the log-odds, as maps may be large; NaN stays NaN."""
    np.negative(log_odds, out=log_odds)
    np.exp(log_odds, out=log_odds)
    log_odds += 1.0
    np.reciprocal(log_odds, out=log_odds)
    return log_odds


def grid_extent(
    points: NDArray[np.float64], resolution_m: float, memory_limit_mb: float, bytes_per_cell: float
) -> tuple[NDArray[np.int64], int, int]:
    """Lower-left corner (x, y) in cells, rows and columns of the grid around points `(n, 2)`, with a margin.

    Raises MethodError if the grid would exceed the memory limit.
    """
    lo = np.floor((points.min(axis=0) - MARGIN_M) / resolution_m).astype(np.int64)
    hi = np.ceil((points.max(axis=0) + MARGIN_M) / resolution_m).astype(np.int64)
    cols, rows = (int(v) for v in hi - lo)
    if bytes_per_cell * rows * cols > memory_limit_mb * 1e6:
        raise MethodError(
            f"the map would have {cols} x {rows} cells, more than memory_limit_mb = {memory_limit_mb:g} holds: "
            "the trajectory is wrong, or raise the limit, or coarsen method.map.resolution_m"
        )
    return lo, rows, cols


def _shortened(
    origin: NDArray[np.float64], endpoints: NDArray[np.float64], chosen: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """The endpoints `(m, 2)`, the chosen ones moved towards the origin (2,) by `SHORTENED_BY_M`."""
    beam = endpoints - origin
    length = np.maximum(np.hypot(beam[:, 0], beam[:, 1]), 1e-9)
    fraction = np.where(chosen, np.maximum(1.0 - SHORTENED_BY_M / length, 0.0), 1.0)
    return np.asarray(origin + beam * fraction[:, None])
