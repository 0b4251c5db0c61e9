"""Moving objects in the views of a fixed camera, followed from frame to frame.

The robot is one of them. Which one, the odometry decides: `environment.py` compares the past of each with the robot's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gridslam.sensors.floor_cells import FloorCells

GAP_CELLS = 2  # cells of one object may have gaps between them
MAX_SPEED_MPS = 2.0  # of a person or a robot
POSITION_STD_M = 0.3  # of an object between frames: its visible side changes
MAX_GAP_S = 1.2  # an object that is not detected for longer is a new one
MAX_FRAMES = 12  # that the past of an object spans


@dataclass(frozen=True, slots=True)
class TrackedObject:
    """An object in one frame: its floor cells, and the earlier frames in which it was detected, latest first."""

    stamp_ns: int
    cells: FloorCells
    past: tuple[tuple[int, FloorCells], ...] = ()

    def continued(self, stamp_ns: int, cells: FloorCells) -> TrackedObject:
        """The same object in a later frame."""
        past = ((self.stamp_ns, self.cells), *self.past)[:MAX_FRAMES]
        return TrackedObject(stamp_ns, cells, past)


class MovingObjectTracker:
    """Follows the objects of one camera."""

    def __init__(self) -> None:
        self._recent: list[TrackedObject] = []

    def add(self, stamp_ns: int, moving: FloorCells) -> list[TrackedObject]:
        """The objects of a frame, each with its past."""
        recent = [o for o in self._recent if stamp_ns - o.stamp_ns <= MAX_GAP_S * 1e9]
        objects = objects_of(moving)
        continues = _continued(stamp_ns, objects, recent)
        found = [
            recent[continues[i]].continued(stamp_ns, cells)
            if i in continues
            else TrackedObject(stamp_ns, cells)
            for i, cells in enumerate(objects)
        ]
        used = set(continues.values())
        self._recent = [o for j, o in enumerate(recent) if j not in used] + found
        return found


def objects_of(moving: FloorCells) -> list[FloorCells]:
    """The moving cells of a frame by connected objects, in the order of their first cells."""
    if not len(moving):
        return []
    first = moving.index.min(axis=0)
    col, row = (moving.index - first).T
    image = np.zeros((row.max() + 1, col.max() + 1), np.uint8)
    image[row, col] = 1
    closed = cv2.dilate(image, np.ones((GAP_CELLS + 1, GAP_CELLS + 1), np.uint8))
    count, labels = cv2.connectedComponents(closed, connectivity=8)
    member = labels[row, col]
    return [moving.select(member == k) for k in range(1, count)]


def _continued(
    stamp_ns: int, objects: Sequence[FloorCells], recent: Sequence[TrackedObject]
) -> dict[int, int]:
    """Index of the recent object that each object continues: pairs by distance, nearest first, none used twice."""
    pairs = []
    for i, cells in enumerate(objects):
        for j, before in enumerate(recent):
            off = cells.centres.mean(axis=0) - before.cells.centres.mean(axis=0)
            distance = float(np.hypot(off[0], off[1]))
            if distance <= POSITION_STD_M + MAX_SPEED_MPS * (stamp_ns - before.stamp_ns) * 1e-9:
                pairs.append((distance, i, j))
    continues: dict[int, int] = {}
    for _, i, j in sorted(pairs):
        if i not in continues and j not in continues.values():
            continues[i] = j
    return continues
