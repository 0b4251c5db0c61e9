"""The world as coloured triangles: segments become upright faces, with a floor and a ceiling."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from gridslam.simulation import geometry
from gridslam.simulation.driving.drive import DrivenRobot
from gridslam.simulation.floor_plan import plan_segments
from gridslam.simulation.geometry import Array
from gridslam.simulation.scene import Scene
from gridslam.simulation.shapes import Surface, Texture
from gridslam.simulation.world_config import WorldConfig

TEXTURES: tuple[str, ...] = get_args(Texture)
CYLINDER_SIDES = 20
CEILING_M = 2.6
MARGIN_M = 2.0  # margin of floor and ceiling around the walls
ROBOT_HEIGHT_M = 0.5
FLOOR = Surface(colour=(130, 125, 115), texture="carpet")
CEILING = Surface(colour=(225, 225, 220), texture="plain")
ROBOT = Surface(colour=(40, 40, 45), texture="plain")


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangles `(n, 3, 3)` in the map frame with colours `(n, 3)` (0 to 255) and the number of their texture `(n,)`."""

    triangles: NDArray[np.float32]
    colours: NDArray[np.float32]
    textures: NDArray[np.int32]


def joined(meshes: Iterable[Mesh]) -> Mesh:
    """All triangles of several meshes."""
    parts = list(meshes)
    return Mesh(
        np.concatenate([np.zeros((0, 3, 3), np.float32), *(m.triangles for m in parts)]),
        np.concatenate([np.zeros((0, 3), np.float32), *(m.colours for m in parts)]),
        np.concatenate([np.zeros(0, np.int32), *(m.textures for m in parts)]),
    )


def static_mesh(world: WorldConfig, folder: Path, scene: Scene) -> Mesh:
    """Walls, furniture, cylinders, floor and ceiling."""
    parts = [upright(geometry.wall(w), w.height_m, w) for w in world.walls]
    parts += [solid(geometry.box(b), b.height_m, b) for b in world.boxes]
    parts += [solid(_ring(c.centre, c.radius_m), c.height_m, c) for c in world.cylinders]
    if world.plan:
        parts.append(upright(plan_segments(world.plan, folder), CEILING_M, Surface()))
    points = scene.static_segments.reshape(-1, 2)
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    corners = geometry.rectangle(*low.tolist(), *high.tolist())[:, :2]
    parts += [lid(corners, 0.0, FLOOR), lid(corners, CEILING_M, CEILING)]
    return joined(parts)


def moving_mesh(world: WorldConfig, scene: Scene, time_s: float) -> Mesh:
    """Doors, tagged objects and people at a time."""
    parts = [solid(geometry.leaf(d, scene.openings[d.id]), d.height_m, d) for d in world.doors]
    parts += [solid(geometry.movable(o, scene.object_poses[o.id]), o.height_m, o) for o in world.objects]
    for walker in scene.walkers:
        x, y, _ = walker.pose(time_s)
        clothes = Surface(colour=walker.person.colour, texture="checks")
        parts.append(solid(_ring((x, y), walker.person.body_radius_m), walker.person.height_m, clothes))
    return joined(parts)


def robot_mesh(world: WorldConfig, robot: DrivenRobot) -> Mesh:
    """The robot as fixed cameras see it."""
    return solid(_ring((robot.x, robot.y), world.robot.radius_m), ROBOT_HEIGHT_M, ROBOT)


def upright(segments: Array, height_m: float, surface: Surface) -> Mesh:
    """Two triangles above each segment `(n, 4)`."""
    a, b = segments[:, :2], segments[:, 2:]
    low, high = np.zeros((len(segments), 1)), np.full((len(segments), 1), height_m)
    a0, b0, a1, b1 = np.c_[a, low], np.c_[b, low], np.c_[a, high], np.c_[b, high]
    return _painted(np.concatenate([np.stack([a0, b0, b1], 1), np.stack([a0, b1, a1], 1)]), surface)


def lid(corners: Array, height_m: float, surface: Surface) -> Mesh:
    """A horizontal face inside a convex polygon `(n, 2)`."""
    points = np.c_[corners, np.full(len(corners), height_m)]
    fans = [(points[0], points[i], points[i + 1]) for i in range(1, len(points) - 1)]
    return _painted(np.array(fans), surface)


def solid(sides: Array, height_m: float, surface: Surface) -> Mesh:
    """A prism over a convex footprint `(n, 4)`, with its top."""
    return joined([upright(sides, height_m, surface), lid(sides[:, :2], height_m, surface)])


def _ring(centre: Sequence[float], radius_m: float) -> Array:
    angle = np.arange(CYLINDER_SIDES) * (2.0 * math.pi / CYLINDER_SIDES)
    points = np.asarray(centre) + radius_m * np.column_stack([np.cos(angle), np.sin(angle)])
    return geometry.polyline(points, closed=True)


def _painted(triangles: Array, surface: Surface) -> Mesh:
    count = len(triangles)
    return Mesh(
        np.ascontiguousarray(triangles, np.float32),
        np.tile(np.array(surface.colour, np.float32), (count, 1)),
        np.full(count, TEXTURES.index(surface.texture), np.int32),
    )
