"""A picture of a world: walls, furniture, doors, objects, people's paths and the robot's route."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridslam.core.errors import ConfigError
from gridslam.core.files import write_atomic
from gridslam.report.figures.chart_data import Chart, Curve
from gridslam.report.figures.charts import draw_charts
from gridslam.report.figures.drawn_shapes import png_of
from gridslam.simulation.scene import Scene
from gridslam.simulation.world_config import WorldConfig

Floats = NDArray[np.float64]

WALL, DOOR, TAG, ROUTE, PERSON, CAMERA = "#1c2028", "#1e6ec8", "#d9661f", "#2f9e44", "#cd2d2d", "#7048e8"
WIDTH_PX, HEIGHTS_PX = 1120, (200, 1120)
CIRCLE_POINTS = 33
# Largest numbers of pieces of walls, and of route points with numbers: with more, the picture would be black and slow to draw
MAX_SEGMENTS, MAX_NUMBERS = 100_000, 1000
HEADING_RATIO = 0.015  # length of a line that shows a heading, as a fraction of the longer side of the world


def draw_world(world: WorldConfig, folder: Path, output: Path) -> None:
    """Write the picture (PNG). Poses are dots with a line along their heading.

    Raises ConfigError: the world has too many walls to be drawn.
    """
    scene = Scene(world, folder)
    if (count := len(scene.static_segments)) > MAX_SEGMENTS:
        raise ConfigError(
            f"--preview: the world has {count} pieces of walls, at most {MAX_SEGMENTS} are drawn; raise plan.simplify_m"
        )
    size = np.ptp(scene.static_segments.reshape(-1, 2), axis=0)
    heading_m = HEADING_RATIO * float(size.max())
    route = np.array([world.robot.start[:2], *world.robot.route])
    has_numbers = len(route) <= MAX_NUMBERS
    poses = [(world.robot.start[0], world.robot.start[1], math.radians(world.robot.start[2]), ROUTE)]
    poses += [(x, y, yaw, TAG) for x, y, yaw in scene.tag_poses().values()]
    for camera in world.fixed_cameras:
        at = camera.extrinsics
        poses.append((at.x, at.y, math.radians(at.yaw_deg), CAMERA))
    people = [np.array(person.path) for person in world.people]
    curves = [
        *_shapes(scene),
        Curve(route[:, 0], route[:, 1], ROUTE, "route", width=0.8, point_px=2.0 if has_numbers else 0.0),
        *(Curve(at[:, 0], at[:, 1], PERSON, "people", width=0.8, is_dashed=True) for at in people),
        *(_heading(x, y, yaw, heading_m, colour) for x, y, yaw, colour in poses),
    ]
    numbered = world.robot.route if has_numbers else ()
    notes = [(float(x), float(y), str(number)) for number, (x, y) in enumerate(numbered)]
    chart = Chart(curves, "x (m)", "y (m)", is_plane=True, notes=notes)
    height = int(np.clip(WIDTH_PX * size[1] / max(size[0], 1e-9), *HEIGHTS_PX))
    write_atomic(output, png_of(draw_charts([chart], WIDTH_PX, height)))


def _shapes(scene: Scene) -> list[Curve]:
    """Curves of walls and furniture, of moving segments (doors), and of circles."""
    bearing = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS)
    curves = [
        Curve(ends[:, 0], ends[:, 1], WALL, width=1.0) for ends in scene.static_segments.reshape(-1, 2, 2)
    ]
    curves += [Curve(ends[:, 0], ends[:, 1], DOOR) for ends in scene.moving_segments.reshape(-1, 2, 2)]
    curves += [
        Curve(x + radius * np.cos(bearing), y + radius * np.sin(bearing), WALL, width=1.0)
        for x, y, radius in scene.circles(0.0).tolist()
    ]
    return curves


def _heading(x: float, y: float, yaw: float, length_m: float, colour: str) -> Curve:
    ends = np.array([[x, y], [x + length_m * math.cos(yaw), y + length_m * math.sin(yaw)]])
    return Curve(ends[:, 0], ends[:, 1], colour, has_start=True)
