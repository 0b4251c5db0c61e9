"""The drawing as a planner needs it: cells that are square in the world, whatever the drawing's scales (paper section 4)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]

MAX_CELLS = 4_000_000
MIN_SIDE_CELLS = 2  # smallest side of a grid on which costs are interpolated
CELL_M = 0.1  # cell of the grid, in metres of the world


@dataclass(frozen=True, slots=True)
class PlanGrid:
    """Drawn walls and free space `(rows, cols)` in cells of `cell_m` of the world.

    `cell_xy` is a cell's size in drawing metres along x and y: the scales times `cell_m`. Positions "in cells" are (x, y) from
    the drawing's lower-left corner.
    """

    walls: Cells
    free: Cells
    cell_m: float
    cell_xy: tuple[float, float]

    def to_cells(self, points: Floats) -> Floats:
        """Drawing units `(n, 2)` in cells."""
        return np.asarray(points) / self.cell_xy

    def to_drawing(self, points: Floats) -> Floats:
        """Cells `(n, 2)` in drawing metres."""
        return np.asarray(points) * self.cell_xy

    def robot_to_cells(self, points_m: Floats, pose: DrawingPose) -> Floats:
        """Points `(n, 2)` of the robot's frame (m) in cells."""
        return self.to_cells(pose.to_drawing(points_m))

    def robot_from_cells(self, points: Floats, pose: DrawingPose) -> Floats:
        """Points `(n, 2)` in cells in the robot's frame (m)."""
        return pose.from_drawing(self.to_drawing(points))

    def cell_of(self, pose: DrawingPose) -> tuple[int, int]:
        """The cell (row, col) of a robot; it may lie outside of the grid."""
        x, y = self.to_cells(np.array([[pose.x, pose.y]]))[0]
        return int(np.floor(y)), int(np.floor(x))


def plan_grid(drawn: DrawnMap, scale_x: float, scale_y: float, cell_m: float = CELL_M) -> PlanGrid:
    """The grid of a drawing at a scale (drawing metres per metre).

    Where several pixels fall into a cell, one wall among them makes it a wall. Cells grow where there would be too many.
    """
    rows, cols = drawn.walls.shape
    step = drawn.geometry.resolution_m
    area = (cols * step / scale_x) * (rows * step / scale_y)
    cell = max(cell_m, float(np.sqrt(area / MAX_CELLS)))
    cell_xy = (cell * scale_x, cell * scale_y)
    size = (
        max(int(np.ceil(cols * step / cell_xy[0])), MIN_SIDE_CELLS),
        max(int(np.ceil(rows * step / cell_xy[1])), MIN_SIDE_CELLS),
    )
    col = np.minimum(((np.arange(size[0]) + 0.5) * cell_xy[0] / step).astype(np.int64), cols - 1)
    row = np.minimum(((np.arange(size[1]) + 0.5) * cell_xy[1] / step).astype(np.int64), rows - 1)
    walls = drawn.walls
    if max(cell_xy) > step:
        size_px = (int(np.ceil(cell_xy[0] / step)), int(np.ceil(cell_xy[1] / step)))
        walls = cv2.dilate(walls.astype(np.uint8), np.ones(size_px[::-1], np.uint8)) > 0
    sampled = np.ix_(row, col)
    return PlanGrid(
        np.asarray(walls[sampled]), np.asarray(drawn.free[sampled] & ~walls[sampled]), cell, cell_xy
    )
