"""Evidence of a drive's scans for every cell: counts of endpoints in it and of beams across it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.grids import log_odds
from gridslam.lidar_slam.grid_map import MARGIN_M, UPDATE, LastUpdates, grid_extent
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.occupancy import GridGeometry

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints = NDArray[np.int64]

BYTES_PER_CELL = 40.0
MAX_RANGE_M = 20.0  # farther away an error of the heading moves a beam past a corner
HITS = log_odds.LogOddsUpdate(hit=1.0, miss=0.0, limit=1e6)
MISSES = log_odds.LogOddsUpdate(hit=0.0, miss=1.0, limit=1e6)


@dataclass(frozen=True, slots=True)
class PlacedScans:
    """Endpoints `(r, 2)` of scans and their viewpoints `(n, 2)` in the map frame, with the scans' stamps `(n,)`."""

    endpoints: Sequence[Floats]
    viewpoints: Floats
    stamps_ns: Ints

    @staticmethod
    def of(scans: Sequence[PreparedScan], poses: Floats) -> PlacedScans:
        """Scans seen from their poses `(n, 3)`."""
        return PlacedScans(
            [se2.transform_points(pose, scan.returns) for pose, scan in zip(poses, scans, strict=True)],
            np.array(
                [
                    se2.transform_points(pose, scan.viewpoint[None])[0]
                    for pose, scan in zip(poses, scans, strict=True)
                ]
            ),
            np.array([scan.stamp_ns for scan in scans], np.int64),
        )


@dataclass(frozen=True, slots=True)
class CellFrame:
    """A grid's lower-left corner (x, y) in cells, its rows, columns and cell size."""

    corner: Ints
    rows: int
    cols: int
    resolution_m: float

    @staticmethod
    def around(
        drives: Sequence[PlacedScans],
        resolution_m: float,
        memory_limit_mb: float,
        earlier: CellFrame | None = None,
    ) -> CellFrame:
        """The grid around all that drives saw, and an earlier grid. Raises MethodError: it would exceed the memory limit."""
        points = [part for drive in drives for part in (*drive.endpoints, drive.viewpoints)]
        if earlier is not None:
            points.append(earlier.inner_corners)
        corner, rows, cols = grid_extent(
            np.concatenate(points), resolution_m, memory_limit_mb, BYTES_PER_CELL
        )
        return CellFrame(corner, rows, cols, resolution_m)

    @property
    def inner_corners(self) -> Floats:
        """Two points `(2, 2)` around which the grid is just as large."""
        low = self.corner + MARGIN_M / self.resolution_m + 0.5
        size = np.array([self.cols, self.rows]) - 2.0 * MARGIN_M / self.resolution_m - 1.0
        return np.asarray(np.stack([low, low + size]) * self.resolution_m)

    @property
    def geometry(self) -> GridGeometry:
        """The geometry of the grid."""
        x, y = (self.corner * self.resolution_m).tolist()
        return GridGeometry(self.resolution_m, (x, y))

    def zeros(self) -> Floats32:
        """A grid `(rows, cols)` of zeros."""
        return np.zeros((self.rows, self.cols), np.float32)


@dataclass(frozen=True, slots=True)
class Evidence:
    """Numbers of scans with an endpoint in each cell within `MAX_RANGE_M`, and of those that looked through it.

    Both are float32 `(rows, cols)`.
    """

    hits: Floats32
    misses: Floats32


def collect_evidence(drive: PlacedScans, frame: CellFrame) -> Evidence:
    """The evidence of one drive's scans."""
    hits, misses, last = frame.zeros(), frame.zeros(), LastUpdates(frame.rows, frame.cols)
    for origin, endpoints in zip(drive.viewpoints, drive.endpoints, strict=True):
        beam = endpoints - origin
        fraction = MAX_RANGE_M / np.maximum(np.hypot(beam[:, 0], beam[:, 1]), 1e-9)
        near = origin + beam * np.minimum(fraction, 1.0)[:, None]
        beams = _in_cells(origin, near, frame)
        is_hit = fraction >= 1.0
        for grid, update in ((hits, HITS), (misses, MISSES)):
            log_odds.insert_scan_dense(
                grid, last.numbers, scan_number=last.next_scan(), beams=beams, is_hit=is_hit, update=update
            )
    return Evidence(hits, misses)


def insert_drive(values: Floats32, last: LastUpdates, drive: PlacedScans, frame: CellFrame) -> None:
    """Add the scans of a drive to log-odds `(rows, cols)` (NaN: unknown); `last` holds the last scan in each cell."""
    for origin, endpoints in zip(drive.viewpoints, drive.endpoints, strict=True):
        log_odds.insert_scan_dense(
            values,
            last.numbers,
            scan_number=last.next_scan(),
            beams=_in_cells(origin, endpoints, frame),
            is_hit=np.ones(len(endpoints), np.bool_),
            update=UPDATE,
        )


def _in_cells(origin: Floats, endpoints: Floats, frame: CellFrame) -> log_odds.BeamBundle:
    return log_odds.BeamBundle(
        origin / frame.resolution_m - frame.corner, endpoints / frame.resolution_m - frame.corner
    )
