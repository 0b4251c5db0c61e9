"""After the tour of the drawing: from frontier to frontier of the observed space, the nearest first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.methods.handmap_slam.config import ExplorationConfig
from gridslam.methods.handmap_slam.driving.observed_grid import ObservedGrid
from gridslam.methods.handmap_slam.driving.pathfinder import FoundPath

Floats = NDArray[np.float64]

PROGRESS_M = 0.2  # smallest shortening of the path that counts as progress
OTHER_VIEWPOINT_M = 1.0  # if the path gets longer by this, it leads to another viewpoint
MAX_COST_PER_M = 3.0  # metres near obstacles cost more
NEAR_M = 0.25  # distance to a viewpoint within which the robot observes from it
LOOK_S = 2.0  # what is not observed from there in this time is abandoned
PATIENCE_S = 20.0  # a viewpoint that gets no closer for this time is abandoned
SETTLE_S = 3.0  # the tour ends if there is no viewpoint for this time


class FrontierTour:
    """Guides the robot from viewpoint to viewpoint, and counts those that were `visited` and `abandoned`."""

    def __init__(self, config: ExplorationConfig) -> None:
        self.observed = ObservedGrid(config)
        self.is_finished = not config.visit_frontiers
        self.visited = self.abandoned = 0
        self._lowest_cost_m = np.inf
        self._progress_ns = 0
        self._near_since_ns: int | None = None
        self._none_since_ns: int | None = None

    def path(self, stamp_ns: int, T_map_base: Floats, radius_m: float) -> FoundPath:
        """The path to the nearest viewpoint; sets `is_finished` if there has been none for a while."""
        viewpoint = self.observed.nearest_viewpoint(T_map_base, radius_m)
        if viewpoint is None:
            return self._wait(stamp_ns)
        self._none_since_ns = None
        cost_m = viewpoint.found.cost_m
        if cost_m > self._lowest_cost_m + OTHER_VIEWPOINT_M:  # another viewpoint: the last one was visited
            self.visited += 1
            self._lowest_cost_m = np.inf
        if cost_m < self._lowest_cost_m - PROGRESS_M:
            self._lowest_cost_m, self._progress_ns = cost_m, stamp_ns
        is_near = cost_m < MAX_COST_PER_M * NEAR_M
        self.observed.takes_every_scan = is_near
        self._near_since_ns = (self._near_since_ns or stamp_ns) if is_near else None
        looked_s = (stamp_ns - (self._near_since_ns or stamp_ns)) * 1e-9
        if looked_s > LOOK_S or (stamp_ns - self._progress_ns) * 1e-9 > PATIENCE_S:
            self.observed.abandon(viewpoint.unobserved)
            self.abandoned += 1
            self._lowest_cost_m, self._progress_ns, self._near_since_ns = np.inf, stamp_ns, None
        return viewpoint.found

    def _wait(self, stamp_ns: int) -> FoundPath:
        """Stand and use every scan: outliers may close a narrow passage for a moment."""
        self.observed.takes_every_scan = True
        self._none_since_ns = stamp_ns if self._none_since_ns is None else self._none_since_ns
        if (stamp_ns - self._none_since_ns) * 1e-9 >= SETTLE_S:
            self.is_finished = True
            self.visited += bool(np.isfinite(self._lowest_cost_m))
        return FoundPath.none()
