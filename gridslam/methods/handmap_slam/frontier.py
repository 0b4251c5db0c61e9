"""What the drawing lacks: when its tour is done, the robot looks at what it has not seen yet, the nearest first.

Beyond the paper, which maps what is drawn: drawings leave out rooms, and what stands in them and hides walls. The whole of the
scans so far lies in one grid of the metric map's frame. Where free space borders on unseen space (Yamauchi 1997) is to be looked
at; the robot goes not to the border but to the nearest place from which it sees over it, so also behind furniture where it does
not fit.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.kernels.raycast import free_squares
from gridslam.kernels.sight_lines import pass_beams, wall_faces
from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.pathfinder import FoundPath, find_path_to_cells, passable_prices
from gridslam.methods.handmap_slam.plan_grid import PlanGrid
from gridslam.methods.handmap_slam.planning_config import FrontierConfig, PathConfig
from gridslam.methods.handmap_slam.seen_scans import HIT_SHARE, STAND_OFF_CELLS, SeenScan
from gridslam.planning.art_gallery import Gallery

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

HALF_SIDE_M = 30.0  # of the grid at first; it doubles when the robot comes near its edge
EDGE_M = 12.0
LARGEST_HALF_M = 500.0
NEARER_M = 0.2
NEXT_M = 1.0  # a nearest view that is suddenly so much farther is another one
NEAR_PRICED = 3.0  # metres beside obstacles cost more
JOINED_CELLS = 2.5  # neighbouring readings farther apart may lie on two things with a gap between
EVERY = 3  # cells between places to look from


@dataclass(frozen=True, slots=True)
class View:
    """The way to a place, and the unseen places `(k, 2)` in the map that are to be seen from there."""

    found: FoundPath
    hidden: Floats


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
            JOINED_CELLS,
        )

    def _is_apart(self, one: Floats, other: Floats) -> bool:
        return float(np.hypot(*(one - other)[:2])) >= self._path.memory_step_m

    def give_up(self, places: Floats) -> None:
        """Unseen places `(k, 2)` in the map cannot be seen, or not be reached for a view."""
        self._given_up = np.concatenate([self._given_up, places])

    def view(self, T_map_base: Floats, radius_m: float) -> View | None:
        """The nearest place to be reached from which the robot sees something new; None when there is none left."""
        if self._last is None:
            return None
        cell_m = self._path.cell_m
        blocked = (self._hit > 0) & (self._hit >= HIT_SHARE * self._passed)
        free = (self._passed > 0) & ~blocked
        window = _bounding(blocked | free)
        blocked, free = blocked[window], free[window]
        offset = np.array([window[1].start, window[0].start])
        grid = PlanGrid(~free, free, cell_m, (cell_m, cell_m))
        x, y = ((self._to_cells(T_map_base[None, :2])[0] - offset) * cell_m).tolist()
        pose = DrawingPose(0, x, y, float(T_map_base[2]), 1.0, 1.0, 0.0, 1.0)
        price = passable_prices(grid, blocked, free, radius_m, self._path)
        price[~free] = np.inf
        least = round(self._config.least_m / cell_m)
        hidden = unseen_beside(free, blocked, least)
        self._without_given_up(hidden, offset)
        if not hidden.any():
            return None
        reach = self._config.view_m / cell_m
        gallery = hidden_gallery(hidden, free)
        candidates = _candidates(np.isfinite(price), hidden, reach, offset)
        sees = gallery.seen_from(np.asarray(candidates[:, ::-1] + 0.5, np.float64), reach)
        good = sees.sum(axis=1) >= least
        if not good.any():
            return None
        found = find_path_to_cells(grid, price, ~free, pose, candidates[good], radius_m)
        if not np.isfinite(found.cost_m):
            return None
        end = grid.robot_to_cells(found.way[-1:], pose) if len(found.way) else np.array([[x, y]]) / cell_m
        chosen = np.flatnonzero(good)[np.hypot(*(candidates[good][:, ::-1] + 0.5 - end).T).argmin()]
        rows, cols = np.unravel_index(gallery.cells[sees[chosen]], free.shape)
        places = (np.column_stack([cols, rows]) + 0.5 + offset - self._half) * cell_m + self._origin
        return View(found, np.asarray(places))

    def _without_given_up(self, hidden: Cells, offset: NDArray[np.int64]) -> None:
        cells = np.floor(self._to_cells(self._given_up) - offset).astype(np.int64)
        inside = ((cells >= 0) & (cells < hidden.shape[::-1])).all(axis=1)
        marked = np.zeros(hidden.shape, np.uint8)
        marked[cells[inside, 1], cells[inside, 0]] = 1
        side = 2 * int(self._config.apart_m / self._path.cell_m) + 1
        hidden &= cv2.dilate(marked, np.ones((side, side), np.uint8)) == 0

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
    """Leads from view to view; `visited` counts those that showed something, `given_up` those that did not."""

    def __init__(self, path: PathConfig, config: FrontierConfig) -> None:
        self._config = config
        self.seen = SeenGrid(path, config)
        self.is_finished = not config.enabled
        self.visited = self.given_up = 0
        self._least_m = np.inf
        self._nearer_ns = 0
        self._near_since_ns: int | None = None
        self._none_since_ns: int | None = None

    def way(self, stamp_ns: int, T_map_base: Floats, radius_m: float) -> FoundPath:
        """The way to the nearest view; `is_finished` afterwards if there is none."""
        view = self.seen.view(T_map_base, radius_m)
        if view is None:
            # stray readings may close a narrow way for a moment: stand, and let every scan count
            self.seen.takes_all = True
            self._none_since_ns = stamp_ns if self._none_since_ns is None else self._none_since_ns
            if (stamp_ns - self._none_since_ns) * 1e-9 >= self._config.settle_s:
                self.is_finished = True
                self.visited += bool(np.isfinite(self._least_m))
            return FoundPath(np.zeros((0, 2)), np.inf)
        self._none_since_ns = None
        found = view.found
        if found.cost_m > self._least_m + NEXT_M:  # that one has been looked at: this is another one
            self.visited += 1
            self._least_m = np.inf
        if found.cost_m < self._least_m - NEARER_M:
            self._least_m, self._nearer_ns = found.cost_m, stamp_ns
        is_near = found.cost_m < NEAR_PRICED * self._config.near_m
        self.seen.takes_all = is_near
        self._near_since_ns = (self._near_since_ns or stamp_ns) if is_near else None
        lingered_s = (stamp_ns - (self._near_since_ns or stamp_ns)) * 1e-9
        if lingered_s > self._config.look_s or (stamp_ns - self._nearer_ns) * 1e-9 > self._config.patience_s:
            self.seen.give_up(view.hidden)
            self.given_up += 1
            self._least_m, self._nearer_ns, self._near_since_ns = np.inf, stamp_ns, None
        return found


def hidden_gallery(hidden: Cells, free: Cells) -> Gallery:
    """Unseen cells `(rows, cols)` as what is to be seen, through free cells alone."""
    middles, owner_cells = wall_faces(np.ascontiguousarray(hidden), np.ascontiguousarray(free))
    cells, owners = np.unique(owner_cells, return_inverse=True)
    return Gallery(
        np.asarray(free_squares(np.ascontiguousarray(~free))), cells, middles, owners.astype(np.int64)
    )


def unseen_beside(free: Cells, blocked: Cells, least_cells: int) -> Cells:
    """Unseen cells beside free ones `(rows, cols)`, in groups of at least so many; gaps between beams count as seen."""
    known = (free | blocked).astype(np.uint8)
    known = np.pad(known, 3)
    closed = cv2.morphologyEx(known, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))[3:-3, 3:-3]
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    beside = (closed == 0) & (cv2.dilate(free.astype(np.uint8), cross) > 0)
    labels = np.asarray(cv2.connectedComponents(beside.astype(np.uint8), connectivity=8)[1])
    sizes = np.bincount(labels[beside], minlength=int(labels.max()) + 1)
    return np.asarray(beside & (sizes >= least_cells)[labels])


def _candidates(passable: Cells, hidden: Cells, reach: float, offset: NDArray[np.int64]) -> NDArray[np.int64]:
    """Passable cells `(k, 2)` (row, col) within reach of unseen ones, every third of each axis of the whole grid."""
    cells = np.argwhere(passable & (distances_to(hidden) <= reach))
    return np.asarray(cells[((cells + offset[::-1]) % EVERY == 0).all(axis=1)])


def _bounding(mask: Cells) -> tuple[slice, slice]:
    """The window of all marked cells with a cell about it."""
    rows, cols = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return (
        slice(max(int(rows[0]) - 1, 0), min(int(rows[-1]) + 2, mask.shape[0])),
        slice(max(int(cols[0]) - 1, 0), min(int(cols[-1]) + 2, mask.shape[1])),
    )
