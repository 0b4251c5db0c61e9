"""Recent scans, kept in the metric map's frame and laid over the drawing when a path is planned (paper section 4).

The metric poses are accurate to centimetres, the drawing is not. Scans are kept in the map and transformed into the drawing by
the current pose, so a door is where the lidar sees it, not where it was drawn.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.messages import LaserScan
from gridslam.kernels.grids.visibility import pass_beams
from gridslam.kernels.scan_matching.scan_points import RangeLimits, scan_to_points
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.plan_grid import PlanGrid
from gridslam.sensors.lidar_beams import LidarExtrinsics

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

MAX_BEAM_M = 8.0  # beams are used up to this length
MAX_SCANS = 60
SCAN_SPACING_M = 0.4  # distance between scans that are kept
FORGET_M = 10.0  # scans taken farther away than this are not used
MAX_SURFACE_GAP_M = 0.4  # gaps between neighbouring endpoints up to this length are closed
# Surfaces per passing beam of a blocked cell; below are outliers and people who have left
MIN_HIT_RATIO = 0.15
MIN_PASSED = 2  # beams through a free cell
STAND_OFF_CELLS = 1.5  # the last cells of a beam before a surface are not free
MIN_BEAMS_WITHOUT_RETURN = 4  # neighbouring beams without return that show free space; fewer are lost beams


@dataclass(frozen=True, slots=True)
class BeamEndpoints:
    """Beams from `origin` `(2,)` to `endpoints` `(n, 2)` (m, robot's frame at the stamp); `is_hit` where they hit something."""

    stamp_ns: int
    origin: Floats
    endpoints: Floats
    is_hit: NDArray[np.bool_]

    @property
    def points(self) -> Floats:
        """The endpoints that hit something `(m, 2)`."""
        return np.asarray(self.endpoints[self.is_hit])


def beam_endpoints(
    scan: LaserScan, extrinsics: LidarExtrinsics, twist: Floats, max_range_m: float
) -> BeamEndpoints:
    """The beams of a scan, cut at `max_range_m`; `twist` (vx, vy, wz) `(3,)` corrects for the motion during the sweep.

    A beam that hits something farther away has the full length, and so has one without return if enough neighbours have none
    either. Single beams without return are lost beams and are dropped, as are NaN and ranges below the sensor's minimum.
    """
    ranges = scan.ranges_m.astype(np.float64)
    limit = min(max_range_m, scan.range_max_m) if scan.range_max_m > 0.0 else max_range_m
    with np.errstate(invalid="ignore"):
        returned = ranges < limit
        usable = np.where(ranges >= limit, limit, ranges).astype(np.float32)
        usable[_lost_beams(~(ranges < scan.range_max_m) & ~np.isnan(ranges))] = np.nan
    limits = RangeLimits(scan.range_min_m, 2.0 * limit)
    endpoints, beams = scan_to_points(usable, extrinsics.sweep_of(scan), limits, extrinsics.pose, twist)
    origin = np.ascontiguousarray(extrinsics.pose[:2])
    return BeamEndpoints(scan.stamp_ns, origin, np.asarray(endpoints), np.asarray(returned[beams]))


def _lost_beams(has_no_return: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The beams without return `(n,)` that are not part of a row of MIN_BEAMS_WITHOUT_RETURN."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], has_no_return, [False]]).astype(np.int8)))
    lost = has_no_return.copy()
    for first, after in zip(edges[::2], edges[1::2], strict=True):
        if after - first >= MIN_BEAMS_WITHOUT_RETURN:
            lost[first:after] = False
    return lost


class ScanMemory:
    """The last scans with their poses T_map_base."""

    def __init__(self) -> None:
        self._kept: deque[tuple[Floats, BeamEndpoints]] = deque(maxlen=MAX_SCANS)
        self._latest: tuple[Floats, BeamEndpoints] | None = None

    def add(self, T_map_base: Floats, scan: BeamEndpoints) -> None:
        """Add the newest scan, at T_map_base `(3,)`; the previous one is kept if it was taken far from the last one kept."""
        if self._latest is not None and self._is_far_from_kept(self._latest[0]):
            self._kept.append(self._latest)
        self._latest = (T_map_base.copy(), scan)

    def _is_far_from_kept(self, pose: Floats) -> bool:
        if not self._kept:
            return True
        return float(np.hypot(*(pose - self._kept[-1][0])[:2])) >= SCAN_SPACING_M

    def cells_on(self, grid: PlanGrid, T_map_base: Floats, pose: DrawingPose) -> tuple[Cells, Cells]:
        """Masks `(rows, cols)` of the grid's cells with observed surfaces, and of those observed to be free.

        The scans lie relative to the robot's current poses T_map_base `(3,)` and, in the drawing, `pose`.
        """
        passed = np.zeros(grid.walls.shape, np.uint16)
        hit = np.zeros(grid.walls.shape, np.uint16)
        for T_map_then, scan in [*self._kept, *([self._latest] if self._latest else [])]:
            T_base_then = se2.between(T_map_base, T_map_then)
            if float(np.hypot(T_base_then[0], T_base_then[1])) > FORGET_M:
                continue
            points = se2.transform_points(T_base_then, np.concatenate([scan.origin[None], scan.endpoints]))
            cells = grid.robot_to_cells(points, pose)
            count_beams(passed, hit, cells, scan.is_hit, grid.cell_m)
        blocked = is_blocked(passed, hit)
        return blocked, (passed >= MIN_PASSED) & ~blocked


def count_beams(
    passed: NDArray[np.uint16],
    hit: NDArray[np.uint16],
    cells: Floats,
    is_hit: NDArray[np.bool_],
    cell_m: float,
) -> None:
    """Count beams and surfaces per cell; `cells` `(1 + n, 2)` are the origin and the endpoints of the beams (x, y in cells)."""
    pass_beams(
        passed=passed,
        hit=hit,
        origin=cells[0],
        endpoints=cells[1:],
        is_hit=is_hit,
        max_range=MAX_BEAM_M / cell_m,
        stand_off=STAND_OFF_CELLS,
        max_gap=MAX_SURFACE_GAP_M / cell_m,
    )


def is_blocked(passed: NDArray[np.uint16], hit: NDArray[np.uint16]) -> Cells:
    """Mask of the cells with enough surfaces (`hit`) for the beams that pass them (`passed`); all arrays `(rows, cols)`."""
    return np.asarray((hit > 0) & (hit >= MIN_HIT_RATIO * passed))
