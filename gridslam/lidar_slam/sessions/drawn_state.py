"""A session's map as it was drawn last, so that the next drive is added to it instead of drawing all drives again."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.lidar_slam.sessions.changes import Change
from gridslam.lidar_slam.sessions.evidence import CellFrame, Evidence

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

MOVED_M = 0.025  # movement of a key scan, or of what it saw, from which it is drawn again: half a usual cell
SEEN_M = 10.0  # distance from the key scan at which a rotation moves what it saw


@dataclass(frozen=True, slots=True)
class DrawnState:
    """The grids of a map with its frame, the changes found so far, and the poses `(k, 3)` of the key scans that are in it.

    `log_odds` are those of the map (NaN: unknown), `state` the evidence since each cell changed last, `layer` that of changes.
    """

    frame: CellFrame
    log_odds: Floats32
    state: Evidence
    layer: NDArray[np.int16]
    changes: list[Change]
    poses: Floats

    @staticmethod
    def nothing(frame: CellFrame) -> DrawnState:
        """An unknown map."""
        unknown = np.full((frame.rows, frame.cols), np.nan, np.float32)
        layer = np.zeros(unknown.shape, np.int16)
        return DrawnState(
            frame=frame,
            log_odds=unknown,
            state=Evidence(frame.zeros(), frame.zeros()),
            layer=layer,
            changes=[],
            poses=np.zeros((0, 3)),
        )

    def is_valid_for(self, poses: Floats, resolution_m: float) -> bool:
        """Whether the map is right where the key scans are now at the poses `(k, 3)`."""
        if self.frame.resolution_m != resolution_m:
            return False
        motion = se2.between(self.poses, poses[: len(self.poses)])
        moved_m = np.hypot(motion[:, 0], motion[:, 1]) + SEEN_M * np.abs(motion[:, 2])
        return bool(moved_m.max(initial=0.0) <= MOVED_M)

    def within(self, frame: CellFrame) -> DrawnState:
        """The same map on a larger frame."""
        first = (self.frame.corner - frame.corner)[::-1]
        rows, cols = (slice(a, a + n) for a, n in zip(first, self.layer.shape, strict=True))
        larger = DrawnState.nothing(frame)
        larger.log_odds[rows, cols] = self.log_odds
        larger.state.hits[rows, cols] = self.state.hits
        larger.state.misses[rows, cols] = self.state.misses
        larger.layer[rows, cols] = self.layer
        changes = [replace(change, cells=change.cells + first) for change in self.changes]
        return replace(larger, changes=changes, poses=self.poses)
