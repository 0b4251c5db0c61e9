"""All scans of an exploration in one grid, and viewpoints from which unobserved space next to free space is visible.

Beyond the paper, which maps what is drawn: drawings omit rooms, and furniture that hides walls. Where free space borders on
unobserved space (frontiers, Yamauchi 1997) there is more to observe. The robot does not go to the frontier itself, but to the
nearest place from which it is visible, so it also looks behind furniture where it does not fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.grids.raycast import free_squares
from gridslam.kernels.grids.visibility import pass_beams, wall_faces
from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.driving.pathfinder import (
    CostGrid,
    FoundPath,
    find_path_to_cells,
    observed_costs,
)
from gridslam.methods.handmap_slam.driving.plan_grid import CELL_M, PlanGrid
from gridslam.methods.handmap_slam.scan_memory import (
    MAX_BEAM_M,
    SCAN_SPACING_M,
    STAND_OFF_CELLS,
    BeamEndpoints,
    is_blocked,
)
from gridslam.planning.art_gallery import Gallery

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

HALF_SIDE_M = 30.0  # half side of the grid at first; it doubles when the robot comes near its edge
EDGE_M = 12.0
MAX_HALF_SIDE_M = 500.0
# Neighbouring endpoints farther apart may lie on two objects with a gap between them
MAX_SURFACE_GAP_CELLS = 2.5
MIN_FRONTIER_M = 0.2  # shorter frontiers are ignored
VIEW_DISTANCE_M = 4.0  # largest distance from a viewpoint to the frontier
ABANDONED_RADIUS_M = 0.2  # frontiers this close to an abandoned one are ignored
CANDIDATE_STEP = 3  # cells between candidates for a viewpoint


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """The path to a viewpoint, and the unobserved places `(k, 2)` in the map that are visible from there."""

    found: FoundPath
    unobserved: Floats


class ObservedGrid:
    """Everything observed so far, in cells of the metric map's frame around the first pose."""

    def __init__(self, config: ExplorationConfig) -> None:
        self._config = config
        self._half = int(HALF_SIDE_M / CELL_M)
        self._origin = np.zeros(2)
        self._passed = np.zeros((0, 0), np.uint16)
        self._hit = np.zeros((0, 0), np.uint16)
        self._last: Floats | None = None
        self.takes_every_scan = False
        self._abandoned = np.zeros((0, 2))

    def add(self, T_map_base: Floats, scan: BeamEndpoints) -> None:
        """Add a scan if it was taken far enough from the last one, or if `takes_every_scan` is set."""
        if not self.takes_every_scan and self._is_near_last(T_map_base):
            return
        if self._last is None:
            self._origin = T_map_base[:2].copy()
            self._passed = np.zeros((2 * self._half, 2 * self._half), np.uint16)
            self._hit = np.zeros_like(self._passed)
        self._last = T_map_base.copy()
        self._grow_around(T_map_base)
        points = se2.transform_points(T_map_base, np.concatenate([scan.origin[None], scan.endpoints]))
        cells = self._to_cells(points)
        pass_beams(
            passed=self._passed,
            hit=self._hit,
            origin=cells[0],
            endpoints=cells[1:],
            is_hit=scan.is_hit,
            max_range=MAX_BEAM_M / CELL_M,
            stand_off=STAND_OFF_CELLS,
            max_gap=MAX_SURFACE_GAP_CELLS,
        )

    def _is_near_last(self, T_map_base: Floats) -> bool:
        if self._last is None:
            return False
        return float(np.hypot(*(T_map_base - self._last)[:2])) < SCAN_SPACING_M

    def abandon(self, places: Floats) -> None:
        """Ignore unobserved places `(k, 2)` in the map from now on: they cannot be observed."""
        self._abandoned = np.concatenate([self._abandoned, places])

    def nearest_viewpoint(self, T_map_base: Floats, radius_m: float) -> Viewpoint | None:
        """The viewpoint with the shortest path from T_map_base `(3,)`, for a robot of a given radius; None without any."""
        if self._last is None:
            return None
        blocked = is_blocked(self._passed, self._hit)
        free = (self._passed > 0) & ~blocked
        window = _bounding_window(blocked | free)
        blocked, free = blocked[window], free[window]
        offset = np.array([window[1].start, window[0].start])
        min_cells = round(MIN_FRONTIER_M / CELL_M)
        frontier = frontier_cells(free, blocked, min_cells)
        self._remove_abandoned(frontier, offset)
        if not frontier.any():
            return None
        grid = PlanGrid(~free, free, CELL_M, (CELL_M, CELL_M))
        x, y = ((self._to_cells(T_map_base[None, :2])[0] - offset) * CELL_M).tolist()
        pose = DrawingPose(
            0, x, y, float(T_map_base[2]), scale_x=1.0, scale_y=1.0, position_std=0.0, inlier_ratio=1.0
        )
        cell_cost = observed_costs(grid, blocked, free, radius_m, self._config)
        cell_cost[~free] = np.inf
        view_range = VIEW_DISTANCE_M / CELL_M
        gallery = frontier_gallery(frontier, free)
        candidates = _candidates(np.isfinite(cell_cost), frontier, view_range, offset)
        visible = gallery.visible_from(np.asarray(candidates[:, ::-1] + 0.5, np.float64), view_range)
        is_useful = visible.sum(axis=1) >= min_cells
        if not is_useful.any():
            return None
        goals = candidates[is_useful]
        found = find_path_to_cells(CostGrid(grid, cell_cost, ~free), pose, goals, radius_m)
        if not np.isfinite(found.cost_m):
            return None
        end = grid.robot_to_cells(found.path[-1:], pose) if len(found.path) else np.array([[x, y]]) / CELL_M
        chosen = np.flatnonzero(is_useful)[np.hypot(*(goals[:, ::-1] + 0.5 - end).T).argmin()]
        rows, cols = np.unravel_index(gallery.cells[visible[chosen]], free.shape)
        return Viewpoint(found, self._to_map(np.column_stack([cols, rows]) + 0.5 + offset))

    def _remove_abandoned(self, frontier: Cells, offset: NDArray[np.int64]) -> None:
        cells = np.floor(self._to_cells(self._abandoned) - offset).astype(np.int64)
        inside = ((cells >= 0) & (cells < frontier.shape[::-1])).all(axis=1)
        marked = np.zeros(frontier.shape, np.uint8)
        marked[cells[inside, 1], cells[inside, 0]] = 1
        side = 2 * int(ABANDONED_RADIUS_M / CELL_M) + 1
        frontier &= cv2.dilate(marked, np.ones((side, side), np.uint8)) == 0

    def _to_cells(self, points: Floats) -> Floats:
        """Map points `(n, 2)` in cells (x, y) of the grid."""
        return np.asarray((points - self._origin) / CELL_M + self._half)

    def _to_map(self, cells: Floats) -> Floats:
        """Cells (x, y) `(n, 2)` of the grid as map points."""
        return np.asarray((cells - self._half) * CELL_M + self._origin)

    def _grow_around(self, T_map_base: Floats) -> None:
        distance = float(np.abs(T_map_base[:2] - self._origin).max()) + EDGE_M
        while distance > self._half * CELL_M and self._half * CELL_M < MAX_HALF_SIDE_M:
            self._passed = np.pad(self._passed, self._half)
            self._hit = np.pad(self._hit, self._half)
            self._half *= 2


def frontier_gallery(frontier: Cells, free: Cells) -> Gallery:
    """Frontier cells `(rows, cols)` as targets of visibility queries, through free cells only."""
    face_centres, owner_cells = wall_faces(np.ascontiguousarray(frontier), np.ascontiguousarray(free))
    cells, owners = np.unique(owner_cells, return_inverse=True)
    return Gallery(
        np.asarray(free_squares(np.ascontiguousarray(~free))), cells, face_centres, owners.astype(np.int64)
    )


def frontier_cells(free: Cells, blocked: Cells, min_cells: int) -> Cells:
    """Unobserved cells next to free ones `(rows, cols)`, in groups of at least `min_cells`; gaps between beams are closed."""
    known = (free | blocked).astype(np.uint8)
    known = np.pad(known, 3)
    closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))[3:-3, 3:-3]
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    frontier = (closed == 0) & (cv2.dilate(free.astype(np.uint8), cross) > 0)
    labels = np.asarray(cv2.connectedComponents(frontier.astype(np.uint8), connectivity=8)[1])
    sizes = np.bincount(labels[frontier], minlength=int(labels.max()) + 1)
    return np.asarray(frontier & (sizes >= min_cells)[labels])


def _candidates(
    is_open: Cells, frontier: Cells, max_distance: float, offset: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Open cells `(k, 2)` (row, col) close to the frontier, every third along each axis of the whole grid."""
    cells = np.argwhere(is_open & (distances_to(frontier) <= max_distance))
    return np.asarray(cells[((cells + offset[::-1]) % CANDIDATE_STEP == 0).all(axis=1)])


def _bounding_window(mask: Cells) -> tuple[slice, slice]:
    """The window of all marked cells, with a border of one cell."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, mask.shape[0])),
        slice(max(int(cols[0]) - 1, 0), min(int(cols[-1]) + 2, mask.shape[1])),
    )
