"""A planned path as a directory: sampled poses, segments, a picture, and a JSON report."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gridslam
from gridslam.core.files import ANY, Identity, write_atomic
from gridslam.core.poses import transform_points, wrap_angle
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.maps.picture import ink
from gridslam.maps.picture.ink import Canvas
from gridslam.methods.base import Table
from gridslam.planning.arcs_and_lines import PlannedPath
from gridslam.planning.path import ArcLinePath, Segment
from gridslam.report.directory import REPORT_FORMAT, REPORT_NAME, new_run_directory
from gridslam.report.figures.chart_data import Chart, Curve
from gridslam.report.figures.charts import draw_charts
from gridslam.report.figures.coloured_curves import coloured_curves
from gridslam.report.figures.drawn_shapes import png_of
from gridslam.report.text_files import write_table

Floats = NDArray[np.float64]

SPACING = 0.05  # largest distance between sampled poses: m, or rad in a turn on the spot
SEGMENT_COLUMNS = (
    "kind", "x", "y", "yaw", "length_m", "radius_m", "angle_rad", "enter_mps", "top_mps", "leave_mps", "time_s",
)  # fmt: skip
FOOTPRINT_SPACING_M = 0.5
END = "\n}"  # the end of an indented JSON document
BORDER_M = 1.5  # of the map around the path
WIDTH_PX, HEIGHTS_PX = 760, (240, 760)  # width, smallest and largest height of the picture
# Largest number of footprints and of points on a straight path along the longer side of the picture
MAX_FOOTPRINTS_ACROSS, MAX_POINTS_ACROSS = 200, 1000
START_COLOUR, GOAL_COLOUR, FOOTPRINT_COLOUR = "#1e9646", "#cd2d2d", "#8fb6e3"
END_PX = 5.0  # radius of start and goal
CIRCLE_POINTS = 33


def plan_document(plan: PlannedPath, map_path: Path) -> dict[str, Any]:
    """The plan as a JSON document: segments, candidates, and poses with their times."""
    times, poses, speeds = plan.path.sampled(SPACING)
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
    """Write the `plan` to `directory`: path.csv, segments.csv, path.png and report.json.

    `occupancy` is the map read from `map_path`; `discs` `(d, 3)` cover the robot: centre x, y in its frame, and radius (m).
    `force`, `before` and the ConfigError raised are those of `new_run_directory`.
    """
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
    """The same text as `json.dumps` with an indent of 2, whose Python encoder would take seconds for the poses of a long path."""
    text = json.dumps({**document, "poses": []}, indent=2, allow_nan=False)
    poses = json.dumps(document["poses"], separators=(",\n      ", ": "), allow_nan=False)
    rows = poses[2:-2].replace("},\n      {", "\n    },\n    {\n      ")
    return f"{text.removesuffix('[]' + END)}[\n    {{\n      {rows}\n    }}\n  ]{END}"


def plan_picture(path: ArcLinePath, occupancy: OccupancyGrid, discs: Floats) -> bytes:
    """A PNG of the map around the path, the path coloured by speed, and the discs of the robot's footprint along it.

    `discs` `(d, 3)` cover the robot: centre x, y in its frame, and radius (m).
    """
    corners = np.array([[s.x, s.y] for s in path.segments])
    _, poses, speeds = path.sampled(max(SPACING, np.ptp(corners, axis=0).max() / MAX_POINTS_ACROSS))
    ends = np.stack([poses[:, :2].min(axis=0) - BORDER_M, poses[:, :2].max(axis=0) + BORDER_M])
    extent = ends[1] - ends[0]
    pieces, scale = coloured_curves(poses[:, :2], np.abs(speeds), "speed (m/s)")
    dots = [
        Curve(poses[[row], 0], poses[[row], 1], colour, point_px=END_PX)
        for row, colour in ((0, START_COLOUR), (-1, GOAL_COLOUR))
    ]
    chart = Chart(
        [
            *_footprints(path, discs, max(FOOTPRINT_SPACING_M, extent.max() / MAX_FOOTPRINTS_ACROSS)),
            *pieces,
            *dots,
        ],
        "x (m)",
        "y (m)",
        f"{path.length_m:.2f} m in {path.time_s:.1f} s",
        is_plane=True,
        scale=scale,
        backdrop=lambda points: _colours_at(occupancy, points),
        within=ends,
    )
    height = int(np.clip(WIDTH_PX * extent[1] / extent[0], *HEIGHTS_PX))
    return png_of(draw_charts([chart], WIDTH_PX, height))


def _colours_at(occupancy: OccupancyGrid, points: Floats) -> Canvas:
    """Colours `(n, 3)` of the map at points `(n, 2)`: white where it is free, dark where there are walls, grey where unknown."""
    cells = occupancy.geometry.cells(points)
    inside = ((cells >= 0) & (cells < occupancy.probability.shape)).all(axis=1)
    probability = np.full(len(points), np.nan, np.float32)
    probability[inside] = occupancy.probability[cells[inside, 0], cells[inside, 1]]
    blended = np.asarray(ink.FREE) + np.nan_to_num(probability)[:, None] * np.subtract(ink.WALL, ink.FREE)
    return np.where(np.isnan(probability)[:, None], ink.UNKNOWN, blended).astype(np.uint8)


def _footprints(path: ArcLinePath, discs: Floats, spacing: float) -> list[Curve]:
    """The contours of the discs every `spacing` m or rad of the path."""
    _, poses, _ = path.sampled(spacing)
    bearing = np.linspace(0.0, 2.0 * np.pi, CIRCLE_POINTS)
    around = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    circles = [
        transform_points(pose, radius * around + (x, y)) for pose in poses for x, y, radius in discs.tolist()
    ]
    return [Curve(at[:, 0], at[:, 1], FOOTPRINT_COLOUR, width=0.7) for at in circles]
