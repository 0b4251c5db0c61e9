"""A place before it becomes a world: walls as polylines, and the lanes that a robot can drive along."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
XY = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Polyline:
    """Corners `(n, 2)` of a wall (m), whether it is closed, and the fraction of light that it sends back."""

    corners: Array
    closed: bool = False
    reflectivity: float = 0.7


@dataclass(frozen=True, slots=True)
class Lane:
    """A straight stretch between two nodes; the robot may drive up to `lateral_m` beside its centre line."""

    first: int
    second: int
    lateral_m: float


@dataclass(slots=True)
class Layout:
    """Walls, the graph of lanes, and the paths of people, in the frame of the place."""

    walls: list[Polyline] = field(default_factory=list)
    nodes: list[XY] = field(default_factory=list)
    lanes: list[Lane] = field(default_factory=list)
    people: list[tuple[XY, XY]] = field(default_factory=list)

    def add_wall(
        self, corners: Sequence[XY] | Array, closed: bool = False, reflectivity: float = 0.7
    ) -> None:
        """Add a wall along corners `(n, 2)` (m)."""
        self.walls.append(Polyline(np.asarray(corners, np.float64), closed, reflectivity))

    def add_box(self, centre: XY, size: XY, yaw_rad: float = 0.0, reflectivity: float = 0.7) -> None:
        """A rectangle of length and width `size` about its centre."""
        half_x, half_y = 0.5 * size[0], 0.5 * size[1]
        corners = np.array([(-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y)])
        self.add_wall(corners @ rotation(yaw_rad).T + centre, True, reflectivity)

    def add_trunk(self, centre: XY, radius_m: float, reflectivity: float = 0.4) -> None:
        """A tree or a pillar: an octagon, which rays find faster than a circle."""
        angles = np.arange(8) * (math.tau / 8)
        ring = radius_m * np.column_stack([np.cos(angles), np.sin(angles)])
        self.add_wall(ring + centre, True, reflectivity)

    def add_node(self, position: XY) -> int:
        """The index of a new node."""
        self.nodes.append(position)
        return len(self.nodes) - 1

    def add_lanes(self, nodes: Iterable[int], lateral_m: float) -> None:
        """Lanes from node to node."""
        row = list(nodes)
        self.lanes += [Lane(a, b, lateral_m) for a, b in itertools.pairwise(row)]

    def distance_to_lanes(self, point: XY) -> float:
        """Distance (m) from a point to the nearest centre line."""
        ends = np.array([(*self.nodes[lane.first], *self.nodes[lane.second]) for lane in self.lanes])
        start, span = ends[:, :2], ends[:, 2:] - ends[:, :2]
        offset = np.asarray(point) - start
        along = np.clip((offset * span).sum(axis=1) / (span**2).sum(axis=1), 0.0, 1.0)
        return float(np.hypot(*(offset - along[:, None] * span).T).min())

    def transformed(self, matrix: Array) -> Layout:
        """The layout under a linear map `(2, 2)` of the plane; straight stays straight."""

        def moved(point: XY) -> XY:
            x, y = (matrix @ np.asarray(point)).tolist()
            return x, y

        walls = [Polyline(wall.corners @ matrix.T, wall.closed, wall.reflectivity) for wall in self.walls]
        people = [(moved(start), moved(end)) for start, end in self.people]
        return Layout(walls, [moved(node) for node in self.nodes], list(self.lanes), people)


def rotation(yaw_rad: float) -> Array:
    """The rotation matrix `(2, 2)`."""
    cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([(cos, -sin), (sin, cos)])
