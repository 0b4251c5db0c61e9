"""A planned path as a directory: sampled poses, segments, a picture, and a JSON report."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import gridslam
from gridslam.core.files import ANY, Identity, write_atomic
from gridslam.core.poses import wrap_angle
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Table
from gridslam.planning.arcs_and_lines import PlannedPath
from gridslam.planning.path import ArcLinePath, Segment
from gridslam.report.directory import REPORT_FORMAT, REPORT_NAME, new_run_directory
from gridslam.report.text_files import write_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Floats = NDArray[np.float64]

SPACING = 0.05  # m or rad between sampled poses
SEGMENT_COLUMNS = (
    "kind", "x", "y", "yaw", "length_m", "radius_m", "angle_rad", "enter_mps", "top_mps", "leave_mps", "time_s",
)  # fmt: skip
FOOTPRINT_SPACING_M = 0.5
END = "\n}"  # of an indented JSON document
MAX_PICTURE_CELLS = 1_000_000
UNKNOWN_SHADE = 0.18
BORDER_M = 1.5
# On the longer side of the picture, which has some 800 pixels
MAX_FOOTPRINTS_ACROSS, MAX_POINTS_ACROSS = 200, 1000
MAX_SIDE_IN, MIN_SIDE_IN = 9.0, 3.5


def plan_document(plan: PlannedPath, map_path: Path, spacing: float = SPACING) -> dict[str, Any]:
    """The plan as JSON: segments, candidates, and poses with their times."""
    times, poses, speeds = plan.path.sampled(spacing)
    rows = np.column_stack([times, poses[:, :2], wrap_angle(poses[:, 2]), speeds])
    return {
        "format": REPORT_FORMAT,
        "command": "plan",
        "version": gridslam.__version__,
        "map": str(map_path),
        "length_m": plan.path.length_m,
        "time_s": plan.path.time_s,
        "chosen": plan.chosen,
        "candidates": [{"name": c.name, "length_m": c.length_m, "time_s": c.time_s} for c in plan.candidates],
        "segments": [dict(zip(SEGMENT_COLUMNS, segment_row(s), strict=True)) for s in plan.path.segments],
        "poses": [dict(zip(("t", "x", "y", "yaw", "speed"), row, strict=True)) for row in rows.tolist()],
    }


def segment_row(segment: Segment) -> tuple[object, ...]:
    """The values of SEGMENT_COLUMNS; the radius is positive to the left, negative to the right, None for a line."""
    radius = segment.radius_m
    signed = math.copysign(radius, segment.curvature) if math.isfinite(radius) else None
    yaw = float(wrap_angle(segment.yaw_rad))
    speeds = (segment.enter_speed, segment.top_speed, segment.leave_speed)
    return (
        segment.kind,
        segment.x,
        segment.y,
        yaw,
        segment.length_m,
        signed,
        segment.angle_rad,
        *speeds,
        segment.time_s,
    )


def write_plan(
    directory: Path,
    plan: PlannedPath,
    occupancy: OccupancyGrid,
    discs: Floats,
    map_path: Path,
    force: bool = False,
    before: Identity | None = ANY,
) -> None:
    """Write path.csv, segments.csv, path.png and report.json; raises ConfigError as `new_run_directory` does."""
    times, poses, speeds = plan.path.sampled(SPACING)
    rows = np.column_stack([times, poses[:, :2], wrap_angle(poses[:, 2]), speeds]).tolist()
    with new_run_directory(directory, force, before) as folder:
        write_table(folder / "path.csv", Table(("t", "x", "y", "yaw", "speed"), rows))
        write_table(
            folder / "segments.csv", Table(SEGMENT_COLUMNS, [segment_row(s) for s in plan.path.segments])
        )
        write_atomic(folder / "path.png", plan_picture(plan.path, occupancy, discs))
        write_atomic(folder / REPORT_NAME, _indented(plan_document(plan, map_path)).encode())


def _indented(document: dict[str, Any]) -> str:
    """The bytes of `json.dumps` with an indent of 2, whose encoder in Python would take seconds for the poses of a long path."""
    text = json.dumps({**document, "poses": []}, indent=2, allow_nan=False)
    poses = json.dumps(document["poses"], separators=(",\n      ", ": "), allow_nan=False)
    rows = poses[2:-2].replace("},\n      {", "\n    },\n    {\n      ")
    return f"{text.removesuffix('[]' + END)}[\n    {{\n      {rows}\n    }}\n  ]{END}"


def plan_picture(path: ArcLinePath, occupancy: OccupancyGrid, discs: Floats) -> bytes:
    """A PNG of the map around the path, the path coloured by speed, and the robot's footprint along it."""
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure

    corners = np.array([[s.x, s.y] for s in path.segments])
    _, poses, speeds = path.sampled(max(SPACING, np.ptp(corners, axis=0).max() / MAX_POINTS_ACROSS))
    low, high = poses[:, :2].min(axis=0) - BORDER_M, poses[:, :2].max(axis=0) + BORDER_M
    extent = high - low
    scale = MAX_SIDE_IN / extent.max()
    width, height = np.maximum(extent * scale, MIN_SIDE_IN)
    figure = Figure(figsize=(width + 1.2, height), dpi=90, layout="constrained")
    axes = figure.add_subplot()
    _draw_map(axes, occupancy, low, high)
    _draw_robot(axes, path, discs, max(FOOTPRINT_SPACING_M, extent.max() / MAX_FOOTPRINTS_ACROSS))
    lines = LineCollection(
        list(np.stack([poses[:-1, :2], poses[1:, :2]], axis=1)),
        array=np.abs(speeds[1:]),
        cmap="plasma",
        linewidths=2.5,
    )
    axes.add_collection(lines)
    axes.plot(*poses[0, :2], "o", color="#1e9646", markersize=8)
    axes.plot(*poses[-1, :2], "o", color="#cd2d2d", markersize=8)
    figure.colorbar(lines, ax=axes, label="speed (m/s)", shrink=0.7)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.set_title(f"{path.length_m:.2f} m in {path.time_s:.1f} s", fontsize=10)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _draw_map(axes: Axes, occupancy: OccupancyGrid, low: Floats, high: Floats) -> None:
    """Draw the cells of the map between the corners `low` and `high` (m, map frame), every n-th of them if they are many."""
    from matplotlib.transforms import Affine2D

    geometry = occupancy.geometry
    corners = np.array([low, [low[0], high[1]], high, [high[0], low[1]]])
    cells = np.clip(geometry.cells(corners), 0, occupancy.probability.shape)
    (r0, c0), (r1, c1) = cells.min(axis=0), np.minimum(cells.max(axis=0) + 1, occupancy.probability.shape)
    step = math.ceil(max((r1 - r0) * (c1 - c0) / MAX_PICTURE_CELLS, 1.0) ** 0.5)
    part = occupancy.probability[r0:r1:step, c0:c1:step]
    shades = np.where(np.isnan(part), UNKNOWN_SHADE, part)
    grid_to_map = (
        Affine2D().scale(geometry.resolution_m).rotate(geometry.yaw_rad).translate(*geometry.origin_xy_m)
    )
    axes.imshow(
        shades,
        cmap="Greys",
        vmin=0.0,
        vmax=1.0,
        origin="lower",
        extent=(c0, c0 + part.shape[1] * step, r0, r0 + part.shape[0] * step),
        interpolation="nearest",
        transform=grid_to_map + axes.transData,
    )


def _draw_robot(axes: Axes, path: ArcLinePath, discs: Floats, spacing: float) -> None:
    """Draw the discs every `spacing` m or rad of the path."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Circle

    _, poses, _ = path.sampled(spacing)
    patches = []
    for x, y, yaw in poses:
        c, s = np.cos(yaw), np.sin(yaw)
        patches += [Circle((x + c * ox - s * oy, y + s * ox + c * oy), radius) for ox, oy, radius in discs]
    is_round = len(discs) == 1
    axes.add_collection(
        PatchCollection(
            patches,
            facecolor="#1e6ec8" if not is_round else "none",
            edgecolor="#1e6ec8" if is_round else "none",
            alpha=0.5 if is_round else 0.12,
            linewidths=0.7,
        )
    )
