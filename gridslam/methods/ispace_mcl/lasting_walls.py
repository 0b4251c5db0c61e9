"""The walls of a map without its furniture, which may stand elsewhere by now, so that nothing behind it is hidden for sure."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

FURNITURE_M = 2.5  # a connected piece of the map that is shorter and narrower may be furniture, or a door that is open now
# Of the occupied cells; with less in walls the map consists of pieces, and each may be of a wall
MIN_WALL_RATIO = 0.3
LARGE_CELLS = 10_000_000  # size of a map whose pieces are not sought: that would take 100 MB and more


def lasting_walls(occupied: NDArray[np.bool_], cell_m: float) -> NDArray[np.bool_]:
    """The cells `(rows, cols)` of the occupied ones that belong to walls; all of them in a map without long walls."""
    if occupied.size > LARGE_CELLS:
        return occupied
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(occupied.astype(np.uint8), connectivity=8)
    size_m = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) * cell_m
    walls = occupied & (size_m >= FURNITURE_M)[labels]
    return walls if walls.sum() >= MIN_WALL_RATIO * occupied.sum() else occupied
