"""What the lidar saw lately, kept in the metric map's frame and laid over the drawing when a path is planned (section 4).

The metric poses are good to centimetres where the drawing is not: kept there and carried into the drawing by the present pose,
a door is where the lidar sees it, not where it was drawn.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan
from gridslam.kernels.scan_points import RangeLimits, Sweep, scan_to_points
from gridslam.kernels.sight_lines import pass_beams
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.plan_grid import PlanGrid
from gridslam.methods.handmap_slam.planning_config import PathConfig
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

HIT_SHARE = 0.15  # a cell with fewer surfaces per passing beam is free: stray readings, people who have left
LEAST_PASSED = 2
STAND_OFF_CELLS = 1.5
LEAST_SILENT = 4  # neighbouring beams without return from which there is nothing indeed


@dataclass(frozen=True, slots=True)
class SeenScan:
    """Beams from `origin` `(2,)` to `ends` `(n, 2)` (m) in the robot's frame of its moment; `is_hit` where they met something."""

    stamp_ns: int
    origin: Floats
    ends: Floats
    is_hit: NDArray[np.bool_]

    @property
    def points(self) -> Floats:
        """What was hit `(m, 2)`."""
        return np.asarray(self.ends[self.is_hit])


def seen_scan(scan: LaserScan, extrinsics: LidarExtrinsics, twist: Floats, reach_m: float) -> SeenScan:
    """The beams of a scan, cut at a reach; `twist` (vx, vy, wz) `(3,)` undoes the motion during the sweep.

    A beam that met something farther away passes all of the reach, and so does one without return if its neighbours have none
    either: single ones are lost beams and say nothing, like NaN and readings below the sensor's least.
    """
    ranges = scan.ranges_m.astype(np.float64)
    limit = min(reach_m, scan.range_max_m) if scan.range_max_m > 0.0 else reach_m
    with np.errstate(invalid="ignore"):
        returned = ranges < limit
        usable = np.where(ranges >= limit, limit, ranges).astype(np.float32)
        usable[_lost(~(ranges < scan.range_max_m) & ~np.isnan(ranges))] = np.nan
    sign = -1.0 if extrinsics.flipped else 1.0
    sweep = Sweep(sign * scan.angle_min_rad, sign * scan.angle_increment_rad, scan.time_increment_s)
    limits = RangeLimits(scan.range_min_m, 2.0 * limit)
    ends, beams = scan_to_points(usable, sweep, limits, extrinsics.pose, twist)
    origin = np.ascontiguousarray(extrinsics.pose[:2])
    return SeenScan(scan.stamp_ns, origin, np.asarray(ends), np.asarray(returned[beams]))


def _lost(silent: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The beams without return `(n,)` that do not stand in a row of at least so many."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], silent, [False]]).astype(np.int8)))
    lost = silent.copy()
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if after - first >= LEAST_SILENT:
            lost[first:after] = False
    return lost


class ScanMemory:
    """The last scans with their poses T_map_base."""

    def __init__(self, config: PathConfig) -> None:
        self._config = config
        self._kept: deque[tuple[Floats, SeenScan]] = deque(maxlen=config.memory_scans)
        self._latest: tuple[Floats, SeenScan] | None = None

    def add(self, T_map_base: Floats, scan: SeenScan) -> None:
        """Take in the newest scan; the one before is kept if it was taken far enough from the last one kept."""
        if self._latest is not None and self._is_apart(self._latest[0]):
            self._kept.append(self._latest)
        self._latest = (T_map_base.copy(), scan)

    def _is_apart(self, pose: Floats) -> bool:
        if not self._kept:
            return True
        return float(np.hypot(*(pose - self._kept[-1][0])[:2])) >= self._config.memory_step_m

    def over(self, grid: PlanGrid, T_map_base: Floats, pose: DrawingPose) -> tuple[Cells, Cells]:
        """Cells of the grid in which surfaces are seen, and cells seen to be free, for the robot's present poses."""
        passed = np.zeros(grid.walls.shape, np.uint16)
        hit = np.zeros(grid.walls.shape, np.uint16)
        scans = [*self._kept, *([self._latest] if self._latest else [])]
        for T_map_then, scan in scans:
            T_base_then = se2.between(T_map_base, T_map_then)
            if float(np.hypot(T_base_then[0], T_base_then[1])) > self._config.memory_m:
                continue
            places = se2.transform_points(T_base_then, np.concatenate([scan.origin[None], scan.ends]))
            cells = grid.robot_to_cells(places, pose)
            pass_beams(
                passed,
                hit,
                cells[0],
                cells[1:],
                scan.is_hit,
                self._config.sight_m / grid.cell_m,
                STAND_OFF_CELLS,
                self._config.joined_m / grid.cell_m,
            )
        blocked = (hit > 0) & (hit >= HIT_SHARE * passed)
        return blocked, (passed >= LEAST_PASSED) & ~blocked
