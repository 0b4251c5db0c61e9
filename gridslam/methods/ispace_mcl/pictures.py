"""Picture of the map with the coverage and the detections of the fixed cameras, and the estimated path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.preview import PathMarks, Tint, render_map
from gridslam.methods.base import Picture
from gridslam.sensors.floor_cells import FloorCells

COVERED, MOVING = (120, 170, 235), (235, 120, 30)
COVERED_OPACITY = 0.45
MIN_MOVING_OPACITY = 0.35  # of a place with one detection; the place with most is opaque
NOTE = "Blue: floor in view of a fixed camera. Orange: moving objects, the robot and people alike; darker where there were more."


def coverage_picture(
    occupancy: OccupancyGrid,
    coverage: FloorCells,
    moving: FloorCells,
    path: Trajectory,
    is_untrusted: NDArray[np.bool_],
) -> Picture:
    """The map with the covered floor cells in blue, the detections in orange by their number, and the path.

    `is_untrusted` `(n,)`: the robot was not localized at these poses of the path.
    """
    covered = np.where(_counts(occupancy, coverage) > 0, np.float32(COVERED_OPACITY), np.float32(0.0))
    detections = _counts(occupancy, moving)
    moved, some = np.zeros(detections.shape, np.float32), detections > 0
    ratio = np.sqrt(detections[some] / max(int(detections.max()), 1))
    moved[some] = MIN_MOVING_OPACITY + (1.0 - MIN_MOVING_OPACITY) * ratio
    tints = (Tint(covered, COVERED, "in view"), Tint(moved, MOVING, "moving"))
    sheet = render_map(occupancy, path, tints=tints, marks=PathMarks(is_untrusted))
    return Picture(np.asarray(sheet, np.uint8), "Fixed cameras: coverage and detections", NOTE)


def _counts(occupancy: OccupancyGrid, cells: FloorCells) -> NDArray[np.int32]:
    """Number of floor cells that cover each map cell `(rows, cols)`; repeated ones count repeatedly."""
    counts = np.zeros(occupancy.probability.shape, np.int32)
    half_width = int(cells.size_m / occupancy.geometry.resolution_m / 2.0)
    for d_row in range(-half_width, half_width + 1):
        for d_col in range(-half_width, half_width + 1):
            offset = np.array([d_row, d_col])
            index = (
                occupancy.geometry.cells(cells.centres) + offset if len(cells) else np.zeros((0, 2), np.int64)
            )
            rows, cols = index[(index >= 0).all(axis=1) & (index < counts.shape).all(axis=1)].T
            np.add.at(counts, (rows, cols), 1)
    return counts
