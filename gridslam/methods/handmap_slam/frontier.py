"""What the drawing lacks: when its tour is done, the borders between what was seen free and what was never seen are visited.

Beyond the paper, which maps what is drawn: drawings leave rooms out. The whole of the scans so far lies in one grid of the
metric map's frame; a border (Yamauchi 1997) that the robot can reach is a goal, the nearest first.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.sight_lines import pass_beams
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.pathfinder import FoundPath, find_path_to_cells, passable_prices
from gridslam.methods.handmap_slam.plan_grid import PlanGrid
from gridslam.methods.handmap_slam.planning_config import FrontierConfig, PathConfig
from gridslam.methods.handmap_slam.seen_scans import HIT_SHARE, STAND_OFF_CELLS, SeenScan

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

HALF_SIDE_M = 30.0  # of the grid at first; it doubles when the robot comes near its edge
EDGE_M = 12.0
LARGEST_HALF_M = 500.0
NEARER_M = 0.2
NEXT_M = 1.0  # a nearest border that is suddenly so much farther is another one


class SeenGrid:
    """Everything seen so far, in cells of the metric map's frame about the place where it began."""

    def __init__(self, path: PathConfig, config: FrontierConfig) -> None:
        self._path, self._config = path, config
        self._half = int(HALF_SIDE_M / path.cell_m)
        self._origin = np.zeros(2)
        self._passed = np.zeros((0, 0), np.uint16)
        self._hit = np.zeros((0, 0), np.uint16)
        self._last: Floats | None = None
        self.takes_all = False
        self._given_up = np.zeros((0, 2))

    def add(self, T_map_base: Floats, scan: SeenScan) -> None:
        """Put a scan in, if it was taken far enough from the last one or `takes_all` is set."""
        if self._last is not None and not self.takes_all and not self._is_apart(T_map_base, self._last):
            return
        if self._last is None:
            self._origin = T_map_base[:2].copy()
            self._passed = np.zeros((2 * self._half, 2 * self._half), np.uint16)
            self._hit = np.zeros_like(self._passed)
        self._last = T_map_base.copy()
        self._make_room(T_map_base)
        places = se2.transform_points(T_map_base, np.concatenate([scan.origin[None], scan.ends]))
        cells = self._to_cells(places)
        cell_m = self._path.cell_m
        pass_beams(
            self._passed,
            self._hit,
            cells[0],
            cells[1:],
            scan.is_hit,
            self._path.sight_m / cell_m,
            STAND_OFF_CELLS,
            self._path.joined_m / cell_m,
        )

    def _is_apart(self, one: Floats, other: Floats) -> bool:
        return float(np.hypot(*(one - other)[:2])) >= self._path.memory_step_m

    def give_up(self, T_map_base: Floats, found: FoundPath) -> None:
        """The border at the end of a way cannot be reached or seen through."""
        end = found.way[-1:] if len(found.way) else np.zeros((1, 2))
        self._given_up = np.concatenate([self._given_up, se2.transform_points(T_map_base, end)])

    def path(self, T_map_base: Floats, radius_m: float) -> FoundPath | None:
        """The way to the nearest border that the robot can reach; None when there is none left."""
        if self._last is None:
            return None
        blocked = (self._hit > 0) & (self._hit >= HIT_SHARE * self._passed)
        free = (self._passed > 0) & ~blocked
        window = _bounding(blocked | free)
        blocked, free = blocked[window], free[window]
        offset = np.array([window[1].start, window[0].start])
        grid = PlanGrid(~free, free, self._path.cell_m, (self._path.cell_m, self._path.cell_m))
        x, y = ((self._to_cells(T_map_base[None, :2])[0] - offset) * self._path.cell_m).tolist()
        pose = DrawingPose(0, x, y, float(T_map_base[2]), 1.0, 1.0, 0.0, 1.0)
        price = passable_prices(grid, blocked, free, radius_m, self._path)
        price[~free] = np.inf
        goals = borders(free, blocked, int(self._config.least_m / self._path.cell_m))
        goals &= np.isfinite(price)
        self._without_given_up(goals, offset)
        if not goals.any():
            return None
        found = find_path_to_cells(grid, price, ~free, pose, np.argwhere(goals), radius_m)
        return found if np.isfinite(found.cost_m) else None

    def _without_given_up(self, goals: Cells, offset: NDArray[np.int64]) -> None:
        reach = int(self._config.apart_m / self._path.cell_m)
        for x, y in self._to_cells(self._given_up) - offset:
            row, col = int(y), int(x)
            goals[
                max(row - reach, 0) : max(row + reach + 1, 0), max(col - reach, 0) : max(col + reach + 1, 0)
            ] = False

    def _to_cells(self, points: Floats) -> Floats:
        """Map points `(n, 2)` in cells (x, y) of the grid."""
        return np.asarray((points - self._origin) / self._path.cell_m + self._half)

    def _make_room(self, T_map_base: Floats) -> None:
        away = float(np.abs(T_map_base[:2] - self._origin).max()) + EDGE_M
        while away > self._half * self._path.cell_m and self._half * self._path.cell_m < LARGEST_HALF_M:
            self._passed = np.pad(self._passed, self._half)
            self._hit = np.pad(self._hit, self._half)
            self._half *= 2


class FrontierTour:
    """Leads from border to border; `visited` counts those left behind, `given_up` those that could not be reached or stayed."""

    def __init__(self, path: PathConfig, config: FrontierConfig) -> None:
        self._config = config
        self.seen = SeenGrid(path, config)
        self.is_finished = not config.enabled
        self.visited = self.given_up = 0
        self._least_m = np.inf
        self._nearer_ns = 0
        self._none_since_ns: int | None = None

    def way(self, stamp_ns: int, T_map_base: Floats, radius_m: float) -> FoundPath:
        """The way to the nearest border; `is_finished` afterwards if there is none."""
        found = self.seen.path(T_map_base, radius_m)
        if found is None:
            # stray readings may close a narrow way for a moment: stand, and let every scan count
            self.seen.takes_all = True
            self._none_since_ns = stamp_ns if self._none_since_ns is None else self._none_since_ns
            if (stamp_ns - self._none_since_ns) * 1e-9 >= self._config.settle_s:
                self.is_finished = True
                self.visited += bool(np.isfinite(self._least_m))
            return FoundPath(np.zeros((0, 2)), np.inf)
        self.seen.takes_all, self._none_since_ns = False, None
        if found.cost_m > self._least_m + NEXT_M:  # that border is seen through: this is another one
            self.visited += 1
            self._least_m = np.inf
        if found.cost_m < self._least_m - NEARER_M:
            self._least_m, self._nearer_ns = found.cost_m, stamp_ns
        away = float(np.hypot(*found.way[-1])) if len(found.way) else 0.0
        if away < self._config.near_m or (stamp_ns - self._nearer_ns) * 1e-9 > self._config.patience_s:
            self.seen.give_up(T_map_base, found)
            self.given_up += 1
            self._least_m, self._nearer_ns = np.inf, stamp_ns
        return found


def borders(free: Cells, blocked: Cells, least_cells: int) -> Cells:
    """Free cells beside unseen ones `(rows, cols)`, in groups of at least so many; gaps between beams count as seen."""
    known = (free | blocked).astype(np.uint8)
    known = np.pad(known, 3)
    closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))[3:-3, 3:-3]
    unseen = (closed == 0).astype(np.uint8)
    beside = cv2.dilate(np.pad(unseen, 1, constant_values=1), np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    edge = free & beside
    joined = cv2.dilate(edge.astype(np.uint8), np.ones((3, 3), np.uint8))
    labels = np.asarray(cv2.connectedComponents(joined, connectivity=8)[1])
    sizes = np.bincount(labels[edge], minlength=int(labels.max()) + 1)
    return np.asarray(edge & (sizes >= least_cells)[labels])


def _bounding(mask: Cells) -> tuple[slice, slice]:
    """The window of all marked cells with a cell about it."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, mask.shape[0])),
        slice(max(int(cols[0]) - 1, 0), min(int(cols[-1]) + 2, mask.shape[1])),
    )
