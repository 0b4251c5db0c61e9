"""The map as a planner needs it: blocked cells with a closed border, and the distance to them everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.clearance import CollisionWorld, is_free
from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.planning.obstacles import obstacle_cells

Floats = NDArray[np.float64]

MIN_DISC_RADIUS_M = 1e-3  # radius of the inner disc for a footprint that has none
SEARCHED_CELLS = 2  # cells on each side of a pose that are searched for room for the robot


@dataclass(frozen=True, slots=True)
class Space:
    """A map and a robot in the grid's own frame: axes of the grid, metres, origin at the outer corner of the border.

    blocked: The map `(rows + 2, cols + 2)` with a border of blocked cells.
    field: Exact distance (m) `(2 rows + 5, 2 cols + 5)` from every cell corner, edge midpoint and cell centre to the nearest
        blocked square.
    geometry: The map's geometry.
    discs: Discs `(n, 3)` (x, y, radius; m, robot frame) that cover the robot.
    margin_m: The clearance that the discs keep from obstacles.
    """

    blocked: NDArray[np.bool_]
    field: NDArray[np.float32]
    geometry: GridGeometry
    discs: Floats
    margin_m: float

    @property
    def resolution_m(self) -> float:
        """Side of a cell (m)."""
        return self.geometry.resolution_m

    @property
    def world(self) -> CollisionWorld:
        """Map and robot for the kernels."""
        return CollisionWorld(self.field, self.blocked, self.resolution_m, self.discs, self.margin_m)

    def world_for_disc(self, radius_m: float) -> CollisionWorld:
        """Map and robot for the kernels, with a disc about the robot's origin in place of the robot."""
        return self.world._replace(discs=np.array([[0.0, 0.0, radius_m]]))

    @property
    def inner_radius_m(self) -> float:
        """Radius (m) of the largest disc about the robot's origin that lies within one of its discs."""
        return float(max((self.discs[:, 2] - np.hypot(self.discs[:, 0], self.discs[:, 1])).max(), 0.0))

    def to_local(self, poses: Floats) -> Floats:
        """Map poses `(n, 3)` in the space's own frame."""
        local = np.array(poses, dtype=np.float64)
        cos, sin = np.cos(self.geometry.yaw_rad), np.sin(self.geometry.yaw_rad)
        local[:, :2] = (local[:, :2] - self.geometry.origin_xy_m) @ np.array([[cos, -sin], [sin, cos]])
        local[:, :2] += self.resolution_m
        local[:, 2] -= self.geometry.yaw_rad
        return local

    def to_map(self, poses: Floats) -> Floats:
        """Poses `(n, 3)` of the space's own frame in the map frame; yaws are not wrapped."""
        out = np.array(poses, dtype=np.float64)
        cos, sin = np.cos(self.geometry.yaw_rad), np.sin(self.geometry.yaw_rad)
        out[:, :2] = (out[:, :2] - self.resolution_m) @ np.array([[cos, sin], [-sin, cos]])
        out[:, :2] += self.geometry.origin_xy_m
        out[:, 2] += self.geometry.yaw_rad
        return out

    def cell(self, pose: Floats) -> tuple[int, int]:
        """The cell (row, col) of a pose in the space's own frame."""
        return int(pose[1] // self.resolution_m), int(pose[0] // self.resolution_m)

    def nearest_open_cell(self, pose: Floats, needed_m: float) -> tuple[int, int]:
        """The cell (row, col) nearest to a pose that has the clearance `needed_m` and a free straight line to the pose.

        Cells up to SEARCHED_CELLS away are searched; if none qualifies, the pose's own cell is returned.
        """
        row, col = self.cell(pose)
        world = self.world_for_disc(needed_m - self.margin_m)
        nearest, cell = np.inf, (row, col)
        for r in range(max(row - SEARCHED_CELLS, 0), min(row + SEARCHED_CELLS + 1, self.blocked.shape[0])):
            for c in range(
                max(col - SEARCHED_CELLS, 0), min(col + SEARCHED_CELLS + 1, self.blocked.shape[1])
            ):
                dx, dy = ((np.array([c, r]) + 0.5) * self.resolution_m - pose[:2]).tolist()
                distance = float(np.hypot(dx, dy))
                if distance < nearest and self.field[2 * r + 1, 2 * c + 1] >= needed_m:
                    heading = np.arctan2(dy, dx)
                    if is_free(world, pose[0], pose[1], heading, distance, curvature=0.0):
                        nearest, cell = distance, (r, c)
        return cell


def make_space(
    occupancy: OccupancyGrid, discs: Floats, margin_m: float, occupied_from: float, unknown_blocks: bool
) -> Space:
    """The space of a map for a robot; `obstacle_cells` decides which cells block."""
    blocked = np.pad(obstacle_cells(occupancy, occupied_from, unknown_blocks), 1, constant_values=True)
    field = distance_field(blocked, occupancy.geometry.resolution_m)
    return Space(blocked, field, occupancy.geometry, discs, margin_m)


def distance_field(blocked: NDArray[np.bool_], resolution_m: float) -> NDArray[np.float32]:
    """Exact distance (m) `(2 rows + 1, 2 cols + 1)` from points half a cell apart to the nearest blocked square.

    In each blocked square, the point nearest to any of these points is also one of them, so a distance transform over the points
    is exact.
    """
    rows, cols = blocked.shape
    squares = np.zeros((2 * rows + 1, 2 * cols + 1), np.uint8)
    squares[1::2, 1::2] = blocked
    squares = cv2.dilate(squares, np.ones((3, 3), np.uint8))
    return distances_to(squares > 0) * np.float32(0.5 * resolution_m)
