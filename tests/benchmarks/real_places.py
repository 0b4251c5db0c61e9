"""The real logs as benchmarks of localization use them, with maps made from reference poses, not by our own SLAM."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import Event, LaserScan
from gridslam.logs import open_log
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.sensors.lidar_beams import LidarExtrinsics, beams_of
from tests.benchmarks.harness import say

CELL_M = 0.05
MAX_WALL_DISTANCE_M = 25.0
HIT, MISS, LIMIT = 0.9, -0.4, 6.0


@dataclass(frozen=True, slots=True)
class RealPlace:
    """Events of a log, its map, and reference poses `(n, 3)` at stamps `(n,)` of scans that are not in the map."""

    events: list[Event]
    grid: OccupancyGrid
    stamps_ns: NDArray[np.int64]
    poses: NDArray[np.float64]


def data_dir() -> Path | None:
    """GRIDSLAM_DATA, or shared/data beside the checkout; None, with a remark, where there is none."""
    folder = Path(os.environ.get("GRIDSLAM_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
    if folder.is_dir():
        return folder
    say(f"no real logs: {folder} is not there; set GRIDSLAM_DATA")
    return None


def events_of(path: Path) -> list[Event]:
    """All events of a log."""
    with open_log(path) as log:
        return list(log.events())


@cache
def place(folder: Path, name: str) -> RealPlace:
    """`aces` or `mit-csail`: the map from every other scan with a reference pose; these scans are taken out of the log."""
    events = events_of(folder / "lidar" / f"{name}.clf.bz2")
    reference = np.loadtxt(folder / "lidar" / f"{name}.reference.txt")
    scans = {event.stamp_ns: event for event in events if isinstance(event, LaserScan)}
    stamps = np.array(sorted(scans))
    nearest = stamps[[int(np.abs(stamps * 1e-9 - time).argmin()) for time in reference[:, 0]]]
    mapped = nearest[::2].tolist()
    grid = map_of([scans[stamp] for stamp in mapped], reference[::2, 1:])
    taken = set(mapped)
    left = [event for event in events if not (isinstance(event, LaserScan) and event.stamp_ns in taken)]
    return RealPlace(left, grid, nearest[1::2], reference[1::2, 1:])


def map_of(scans: list[LaserScan], poses: NDArray[np.float64]) -> OccupancyGrid:
    """Log-odds of beams sampled at half a cell; the lidar sits at the robot's centre in these logs."""
    corner = poses[:, :2].min(axis=0) - MAX_WALL_DISTANCE_M - 1.0
    cols, rows = (
        int(n) for n in np.ceil((poses[:, :2].max(axis=0) + MAX_WALL_DISTANCE_M + 1.0 - corner) / CELL_M)
    )
    hits, misses = np.zeros(rows * cols), np.zeros(rows * cols)
    fractions = np.arange(int(2 * MAX_WALL_DISTANCE_M / CELL_M)) / (2 * MAX_WALL_DISTANCE_M / CELL_M)
    for scan, pose in zip(scans, poses, strict=True):
        ends = se2.transform_points(
            pose, beams_of(scan, LidarExtrinsics(np.zeros(3)), 0.1, MAX_WALL_DISTANCE_M).points
        )
        lengths = np.hypot(*(ends - pose[:2]).T)
        paths = (
            pose[:2]
            + (ends - pose[:2])[:, None] * (fractions * MAX_WALL_DISTANCE_M / lengths[:, None])[..., None]
        )
        inside = fractions * MAX_WALL_DISTANCE_M < (lengths - CELL_M)[:, None]
        at_end = _flat(ends, corner, cols)
        crossed = np.unique(_flat(paths[inside], corner, cols))
        misses[np.setdiff1d(crossed, at_end)] += 1.0
        hits[np.unique(at_end)] += 1.0
    log_odds = np.clip(HIT * hits + MISS * misses, -LIMIT, LIMIT)
    probability = np.where(hits + misses > 0, 1.0 / (1.0 + np.exp(-log_odds)), np.nan)
    geometry = GridGeometry(CELL_M, (float(corner[0]), float(corner[1])))
    return OccupancyGrid(probability.reshape(rows, cols).astype(np.float32), geometry)


def _flat(points: NDArray[np.float64], corner: NDArray[np.float64], cols: int) -> NDArray[np.int64]:
    cells = np.floor((points - corner) / CELL_M).astype(np.int64)
    return np.asarray(cells[:, 1] * cols + cells[:, 0])
