"""The map as a planner sees it: blocked cells with a closed border, and the distance to them everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.planning.clearance import World, is_free
from gridslam.maps.distances import distances_to
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.planning.obstacles import obstacle_cells

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Space:
    """Where a robot can be. Its own frame: axes of the grid, metres, origin at the corner of the border's corner cell.

    `blocked` `(rows + 2, cols + 2)` is the map with a border of blocked cells; `field` `(2 rows + 5, 2 cols + 5)` the exact
    distance (m) from every corner, middle of an edge and centre of a cell to the nearest blocked square. `discs` `(n, 3)` is the
    robot and `margin_m` what it keeps off obstacles.
    """

    blocked: NDArray[np.bool_]
    field: NDArray[np.float32]
    geometry: GridGeometry
    discs: Floats
    margin_m: float

    @property
    def resolution_m(self) -> float:
        """The side of a cell."""
        return self.geometry.resolution_m

    @property
    def world(self) -> World:
        """What the kernels take."""
        return World(self.field, self.blocked, self.resolution_m, self.discs, self.margin_m)

    def world_of(self, radius_m: float) -> World:
        """The same for a disc about the robot's origin instead of the robot."""
        return self.world._replace(discs=np.array([[0.0, 0.0, radius_m]]))

    @property
    def inner_radius_m(self) -> float:
        """The radius of the largest disc about the robot's origin that lies within one of its discs."""
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
        """The nearest cell (row, col) to a pose that has `needed_m` about its centre and a straight way to the pose.

        It is at most two cells off; where there is none, the pose's own cell is given.
        """
        row, col = self.cell(pose)
        world = self.world_of(needed_m - self.margin_m)
        nearest, at = np.inf, (row, col)
        for r in range(max(row - 2, 0), min(row + 3, self.blocked.shape[0])):
            for c in range(max(col - 2, 0), min(col + 3, self.blocked.shape[1])):
                dx, dy = ((np.array([c, r]) + 0.5) * self.resolution_m - pose[:2]).tolist()
                way = float(np.hypot(dx, dy))
                if way < nearest and self.field[2 * r + 1, 2 * c + 1] >= needed_m:
                    towards = np.arctan2(dy, dx)
                    if is_free(world, pose[0], pose[1], towards, way, 0.0):
                        nearest, at = way, (r, c)
        return at


def make_space(
    occupancy: OccupancyGrid, discs: Floats, margin_m: float, occupied_from: float, unknown_blocks: bool
) -> Space:
    """The space of a map for a robot; see `obstacle_cells` for what blocks."""
    blocked = np.pad(obstacle_cells(occupancy, occupied_from, unknown_blocks), 1, constant_values=True)
    field = distance_field(blocked, occupancy.geometry.resolution_m)
    return Space(blocked, field, occupancy.geometry, discs, margin_m)


def distance_field(blocked: NDArray[np.bool_], resolution_m: float) -> NDArray[np.float32]:
    """Exact distance (m) `(2 rows + 1, 2 cols + 1)` from the points half a cell apart to the nearest blocked square.

    The point of a square that is nearest to one of these points is itself one of them, so a distance transform between
    points is exact.
    """
    rows, cols = blocked.shape
    squares = np.zeros((2 * rows + 1, 2 * cols + 1), np.uint8)
    squares[1::2, 1::2] = blocked
    squares = cv2.dilate(squares, np.ones((3, 3), np.uint8))
    return distances_to(squares > 0) * np.float32(0.5 * resolution_m)
