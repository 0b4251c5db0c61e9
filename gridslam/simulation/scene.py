"""The world as rays see it: static shapes, doors and objects moved at waypoints, and walking people."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.random import random_stream
from gridslam.simulation import geometry
from gridslam.simulation.geometry import NO_SEGMENTS, Array
from gridslam.simulation.people import Walker
from gridslam.simulation.shapes import Door, MovableObject, PoseDeg
from gridslam.simulation.world_config import WorldConfig

if TYPE_CHECKING:
    from gridslam.kernels.segments import BucketGrid

MAX_CELLS = 400_000
LEG_REFLECTIVITY = 0.4
PLAN_REFLECTIVITY = 0.7


@dataclass(frozen=True, slots=True)
class Hits:
    """First hits of rays, `(m,)` each: distance (m), reflectivity (0 without a hit), cosine of incidence, hit or not."""

    ranges_m: Array
    reflectivity: Array
    cosines: Array
    is_hit: NDArray[np.bool_]


class Scene:
    """All shapes of a world in their present state."""

    def __init__(self, world: WorldConfig, folder: Path) -> None:
        self.world = world
        self.static_segments, self._static_reflectivity = static_segments(world, folder)
        self.cylinders = np.array([(*c.centre, c.radius_m) for c in world.cylinders]).reshape(-1, 3)
        self._cylinder_reflectivity = np.array([c.reflectivity for c in world.cylinders])
        self._grid = _grid_of(self.static_segments)
        self._buckets: tuple[NDArray[np.int32], NDArray[np.int32]] | None = None
        self.walkers = [
            Walker(person, random_stream(world.seed, f"person {i}")) for i, person in enumerate(world.people)
        ]
        self.openings: dict[str, float] = {door.id: door.opening_deg for door in world.doors}
        self.object_poses: dict[str, PoseDeg] = {obj.id: obj.pose for obj in world.objects}
        self.moving_segments = NO_SEGMENTS
        self._refresh()

    def arrive_at_waypoint(self, waypoint: int) -> None:
        """Move the doors and objects that the world file moves when the robot reaches this waypoint of its route."""
        for door in self.world.doors:
            if waypoint in door.openings_deg:
                self.openings[door.id] = door.openings_deg[waypoint]
        for obj in self.world.objects:
            if waypoint in obj.moves:
                self.object_poses[obj.id] = obj.moves[waypoint]
        self._refresh()

    def tag_poses(self) -> dict[str, Array]:
        """Pose `(3,)` of each tag by its id: x, y (m) and the direction of its normal (rad)."""
        found = {}
        for obj in self.world.movable_objects:
            if obj.tag:
                own = geometry.radians((*obj.tag.position, obj.tag.facing_deg))
                found[obj.tag.id] = se2.compose(self.pose_of(obj), own)
        return found

    def pose_of(self, obj: Door | MovableObject) -> Array:
        """Present pose `(3,)` of a door's leaf (at the hinge) or of an object (at its centre) in the map frame."""
        if isinstance(obj, Door):
            return geometry.door_pose(obj, self.openings[obj.id])
        return geometry.radians(self.object_poses[obj.id])

    def circles(self, time_s: float) -> Array:
        """Cylinders and the legs of people at a time, as circles `(n, 3)` of x, y, radius."""
        return np.concatenate([self.cylinders, *(w.legs(time_s) for w in self.walkers)]).reshape(-1, 3)

    def cast(self, rays: Array, max_range_m: float, time_s: float) -> Hits:
        """First hits of rays `(m, 4)` (origin and unit direction) within `max_range_m` at a time."""
        from gridslam.kernels.segments import cast_segments, fill_buckets

        if self._buckets is None:
            self._buckets = fill_buckets(self.static_segments, self._grid)
        circles = self.circles(time_s)
        starts, items = self._buckets
        ranges, index, cosines = cast_segments(
            segments=self.static_segments,
            starts=starts,
            items=items,
            grid=self._grid,
            moving=self.moving_segments,
            circles=circles,
            rays=rays,
            max_range=max_range_m,
        )
        legs = np.full(len(circles) - len(self.cylinders), LEG_REFLECTIVITY)
        reflectivity = np.concatenate(
            [self._static_reflectivity, self._moving_reflectivity, self._cylinder_reflectivity, legs, [0.0]]
        )
        return Hits(ranges, reflectivity[index], cosines, index >= 0)

    def _refresh(self) -> None:
        doors = [(geometry.leaf(d, self.openings[d.id]), d.reflectivity) for d in self.world.doors]
        objects = [(geometry.movable(o, self.object_poses[o.id]), o.reflectivity) for o in self.world.objects]
        self.moving_segments = np.concatenate(
            [NO_SEGMENTS, *(segments for segments, _ in (*doors, *objects))]
        )
        reflectivities = [np.full(len(segments), value) for segments, value in (*doors, *objects)]
        self._moving_reflectivity = np.concatenate([np.zeros(0), *reflectivities])


def static_segments(world: WorldConfig, folder: Path) -> tuple[Array, Array]:
    """Segments `(n, 4)` of walls, boxes and the floor plan, and their reflectivities `(n,)`."""
    pieces = [(geometry.wall(w), w.reflectivity) for w in world.walls]
    pieces += [(geometry.box(b), b.reflectivity) for b in world.boxes]
    if world.plan:
        from gridslam.simulation.floor_plan import plan_segments

        pieces.append((plan_segments(world.plan, folder), PLAN_REFLECTIVITY))
    segments = np.concatenate([NO_SEGMENTS, *(piece for piece, _ in pieces)])
    reflectivities = np.concatenate([np.zeros(0), *(np.full(len(piece), value) for piece, value in pieces)])
    return np.ascontiguousarray(segments), reflectivities


def _grid_of(segments: Array) -> BucketGrid:
    """A grid of buckets of half a metre, or larger ones in a large world."""
    from gridslam.kernels.segments import BucketGrid

    if not len(segments):
        return BucketGrid(0.0, 0.0, size=1.0, rows=1, cols=1)
    points = segments.reshape(-1, 2)
    low, high = points.min(axis=0) - 0.01, points.max(axis=0) + 0.01
    width, height = (float(v) for v in high - low)
    size = max(0.5, (width * height / MAX_CELLS) ** 0.5)
    rows, cols = int(height / size) + 1, int(width / size) + 1
    return BucketGrid(float(low[0]), float(low[1]), size, rows, cols)
