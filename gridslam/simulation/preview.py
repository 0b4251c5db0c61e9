"""A picture of a world: walls, furniture, doors, objects, people's paths and the robot's route."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from gridslam.core.files import write_atomic
from gridslam.simulation.scene import Scene
from gridslam.simulation.world_config import WorldConfig

MAX_SIZE_IN = 14.0


def draw_world(world: WorldConfig, folder: Path, output: Path) -> None:
    """Write the picture (PNG)."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    scene = Scene(world, folder)
    points = scene.static_segments.reshape(-1, 2)
    width, height = (float(v) for v in np.ptp(points, axis=0) + 1.0)
    scale = MAX_SIZE_IN / max(width, height)
    figure = Figure(figsize=(max(width * scale, 3.0) + 1.0, max(height * scale, 2.0) + 1.0), dpi=80)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _draw_shapes(axes, scene)
    _draw_route(axes, world)
    for person in world.people:
        axes.plot(*np.array(person.path).T, color="tab:red", linestyle=":", linewidth=1)
    for camera in world.fixed_cameras:
        _draw_arrow(
            axes,
            camera.extrinsics.x,
            camera.extrinsics.y,
            math.radians(camera.extrinsics.yaw_deg),
            "tab:purple",
        )
    axes.set_aspect("equal")
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.tight_layout()
    picture = io.BytesIO()
    figure.savefig(picture, format="png", metadata={"Software": None})
    write_atomic(output, picture.getvalue())


def _draw_shapes(axes: Any, scene: Scene) -> None:
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Circle

    axes.add_collection(
        LineCollection(list(scene.static_segments.reshape(-1, 2, 2)), colors="black", linewidths=1.2)
    )
    axes.add_collection(
        LineCollection(list(scene.moving_segments.reshape(-1, 2, 2)), colors="tab:blue", linewidths=1.5)
    )
    for x, y, radius in scene.circles(0.0).tolist():
        axes.add_patch(Circle((x, y), radius, fill=False, color="black"))
    for x, y, yaw in scene.tag_poses().values():
        _draw_arrow(axes, x, y, yaw, "tab:orange")
    axes.autoscale_view()


def _draw_route(axes: Any, world: WorldConfig) -> None:
    x, y, yaw_deg = world.robot.start
    route = np.array([(x, y), *world.robot.route])
    axes.plot(*route.T, color="tab:green", linewidth=0.8, marker=".", markersize=4)
    _draw_arrow(axes, x, y, math.radians(yaw_deg), "tab:green")
    for index, (px, py) in enumerate(world.robot.route):
        axes.annotate(str(index), (px, py), fontsize=6, color="tab:green")


def _draw_arrow(axes: Any, x: float, y: float, yaw: float, colour: str) -> None:
    """Draw an arrow whose size does not depend on the scale."""
    axes.quiver(
        x, y, math.cos(yaw), math.sin(yaw), color=colour, angles="xy", units="inches", width=0.02, scale=4.0
    )
