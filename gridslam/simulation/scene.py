"""The world as rays see it: what stands, what was moved at way points, and who walks about."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core import poses as se2
from gridslam.core.random import random_stream
from gridslam.simulation import outlines
from gridslam.simulation.outlines import NO_SEGMENTS, Array
from gridslam.simulation.people import Walker
from gridslam.simulation.shapes import Door, PoseDeg, TaggedObject
from gridslam.simulation.world_config import World

MOST_CELLS = 400_000
LEG_REFLECTIVITY = 0.4


@dataclass(frozen=True, slots=True)
class Hits:
    """What rays met: distances `(m,)`, reflectivities `(m,)` (0 where nothing was hit), cosines of incidence `(m,)`."""

    ranges_m: Array
    reflectivity: Array
    cosines: Array
    is_hit: NDArray[np.bool_]


class Scene:
    """All outlines of a world at a moment."""

    def __init__(self, world: World, folder: Path) -> None:
        self.world = world
        standing, light = standing_segments(world, folder)
        self.standing = standing
        self.cylinders = np.array([(*c.centre, c.radius_m) for c in world.cylinders]).reshape(-1, 3)
        self._standing_light = light
        self._cylinder_light = np.array([c.reflectivity for c in world.cylinders])
        self._grid = _grid_of(standing)
        self._buckets: tuple[NDArray[np.int32], NDArray[np.int32]] | None = None
        self.walkers = [
            Walker(p, random_stream(world.seed, f"person {i}")) for i, p in enumerate(world.people)
        ]
        self.openings: dict[str, float] = {door.id: door.opening_deg for door in world.doors}
        self.object_poses: dict[str, PoseDeg] = {thing.id: thing.pose for thing in world.objects}
        self.moving = NO_SEGMENTS
        self._refresh()

    def reach(self, way_point: int) -> None:
        """Let happen what the world file says for the moment when the robot reaches this way point of its route."""
        for door in self.world.doors:
            if way_point in door.turns:
                self.openings[door.id] = door.turns[way_point]
        for thing in self.world.objects:
            if way_point in thing.moves:
                self.object_poses[thing.id] = thing.moves[way_point]
        self._refresh()

    def tag_poses(self) -> dict[str, Array]:
        """Where the tags are: x, y, direction of the normal, by tag id."""
        found = {}
        for thing in self.world.things:
            if thing.tag:
                own = outlines.radians((*thing.tag.position, thing.tag.facing_deg))
                found[thing.tag.id] = se2.compose(self.pose_of(thing), own)
        return found

    def pose_of(self, thing: Door | TaggedObject) -> Array:
        """Where a door's leaf (its hinge) or an object (its centre) is now."""
        if isinstance(thing, Door):
            return outlines.door_pose(thing, self.openings[thing.id])
        return outlines.radians(self.object_poses[thing.id])

    def circles(self, time_s: float) -> Array:
        """Pillars, and the legs of people."""
        return np.concatenate([self.cylinders, *(w.legs(time_s) for w in self.walkers)]).reshape(-1, 3)

    def cast(self, rays: Array, reach_m: float, time_s: float) -> Hits:
        """What rays `(m, 4)` of origin and unit direction meet first at a time."""
        from gridslam.kernels.segments import cast_segments, fill_buckets

        if self._buckets is None:
            self._buckets = fill_buckets(self.standing, *self._grid)
        circles = self.circles(time_s)
        ranges, index, cosines = cast_segments(
            self.standing, *self._buckets, self._grid, self.moving, circles, rays, reach_m
        )
        legs = np.full(len(circles) - len(self.cylinders), LEG_REFLECTIVITY)
        light = np.concatenate([self._standing_light, self._moving_light, self._cylinder_light, legs, [0.0]])
        return Hits(ranges, light[index], cosines, index >= 0)

    def _refresh(self) -> None:
        doors = [(outlines.leaf(d, self.openings[d.id]), d.reflectivity) for d in self.world.doors]
        things = [(outlines.tagged(o, self.object_poses[o.id]), o.reflectivity) for o in self.world.objects]
        self.moving = np.concatenate([NO_SEGMENTS, *(segments for segments, _ in (*doors, *things))])
        lights = [np.full(len(segments), light) for segments, light in (*doors, *things)]
        self._moving_light = np.concatenate([np.zeros(0), *lights])


def standing_segments(world: World, folder: Path) -> tuple[Array, Array]:
    """Everything that never moves and is straight `(n, 4)`, and its reflectivities `(n,)`."""
    pieces = [(outlines.wall(w), w.reflectivity) for w in world.walls]
    pieces += [(outlines.box(b), b.reflectivity) for b in world.boxes]
    if world.plan:
        from gridslam.simulation.plan import plan_segments

        pieces.append((plan_segments(world.plan, folder), 0.7))
    segments = np.concatenate([NO_SEGMENTS, *(piece for piece, _ in pieces)])
    light = np.concatenate([np.zeros(0), *(np.full(len(piece), share) for piece, share in pieces)])
    return np.ascontiguousarray(segments), light


def _grid_of(segments: Array) -> tuple[float, float, float, int, int]:
    """Origin, cell size, rows and columns of the buckets: about half a metre, fewer where the world is large."""
    if not len(segments):
        return 0.0, 0.0, 1.0, 1, 1
    points = segments.reshape(-1, 2)
    low, high = points.min(axis=0) - 0.01, points.max(axis=0) + 0.01
    width, height = (float(v) for v in high - low)
    size = max(0.5, (width * height / MOST_CELLS) ** 0.5)
    return float(low[0]), float(low[1]), size, int(height / size) + 1, int(width / size) + 1
