"""Moving objects in the views of a fixed camera, followed from frame to frame.

The robot is one of them. Which one, the odometry decides: `environment.py` compares the past of each with the robot's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.sensors.floor_cells import FloorCells

GAP_CELLS = 2  # cells of one object may have gaps between them
MAX_SPEED_MPS = 2.0  # highest speed of a person or a robot
POSITION_STD_M = 0.3  # standard deviation of an object between frames: its visible side changes
MAX_GAP_S = 1.2  # an object that is not detected for longer is a new one
MAX_FRAMES = 12  # largest number of frames in the past of an object
AMBIGUOUS_M = 0.5  # an object is not known to continue another one if a second pair is nearly as near as this


@dataclass(frozen=True, slots=True)
class TrackedObject:
    """An object in one frame: its floor cells, and the earlier frames in which it was detected, latest first.

    `was_expected`: an object was near by in the frame before. The past is that since when it is certain to be the same one.
    """

    stamp_ns: int
    cells: FloorCells
    past: tuple[tuple[int, FloorCells], ...] = ()
    was_expected: bool = False

    def continued(self, stamp_ns: int, cells: FloorCells, is_certain: bool) -> TrackedObject:
        """The same object in a later frame; with a new past if it may be another one."""
        past = ((self.stamp_ns, self.cells), *self.past)[:MAX_FRAMES] if is_certain else ()
        return TrackedObject(stamp_ns, cells, past, was_expected=True)


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
            recent[continues[i][0]].continued(stamp_ns, cells, is_certain=continues[i][1])
            if i in continues
            else TrackedObject(stamp_ns, cells)
            for i, cells in enumerate(objects)
        ]
        used = {j for j, _ in continues.values()}
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
) -> dict[int, tuple[int, bool]]:
    """Index of the recent object that each object continues, and whether that is certain: pairs by distance, none used twice.

    It is uncertain where people meet the robot or each other: they become one object, part again, or hide each other.
    """
    off = np.array([[_centre(cells) - _centre(before.cells) for before in recent] for cells in objects])
    distance = np.hypot(*np.moveaxis(off.reshape(len(objects), len(recent), 2), 2, 0))
    age_s = np.array([stamp_ns - before.stamp_ns for before in recent]) * 1e-9
    near = np.argwhere(distance <= POSITION_STD_M + MAX_SPEED_MPS * age_s)
    continues: dict[int, tuple[int, bool]] = {}
    used: set[int] = set()
    for i, j in sorted(near.tolist(), key=lambda pair: (distance[pair[0], pair[1]], *pair)):
        if i in continues or j in used:
            continue
        rivals = (distance[i] < distance[i, j] + AMBIGUOUS_M).sum() + (
            distance[:, j] < distance[i, j] + AMBIGUOUS_M
        ).sum()
        continues[i] = (j, bool(rivals == 2))  # the pair itself is in both sums
        used.add(j)
    return continues


def _centre(cells: FloorCells) -> NDArray[np.float64]:
    return np.asarray(cells.centres.mean(axis=0))
