"""Results about the drawing: observed lines, series, layers, measures and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import format_stamp
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.drawings.drawing import DrawnMap
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.methods.base import Picture, Series, Table
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawing_tracker import DrawingUpdate
from gridslam.methods.handmap_slam.line_observation import LineObserver

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

MATCHING_INLIER_RATIO = 0.7  # with a lower mean inlier ratio the drawing shows another place
OBSERVED_SIGMAS = 2.0  # a drawn wall closer than this to a point was observed
MAP_COLOUR = (200, 60, 40)
PATH_COLOUR = (30, 110, 200)
START_COLOUR = (30, 150, 70)
WALL_COLOUR = (60, 66, 76)
OUTSIDE_COLOUR = (214, 218, 224)
MIN_PICTURE_PX, MAX_PICTURE_PX = 700, 1600
START_DOT_PX = 4

LINE_COLUMNS = (
    "stamp", "line", "family", "x0", "y0", "x1", "y1", "drawn_m", "observed_m", "probability",
)  # fmt: skip


def line_table(updates: Sequence[DrawingUpdate], observer: LineObserver) -> Table:
    """One row per update and drawn line in view; the segment in the drawing frame, distances in metres."""
    rows = []
    for update in updates:
        for line in update.lines:
            ends = (*observer.lines.starts[line.line], *observer.lines.ends[line.line])
            numbers = [round(float(v), 3) for v in (*ends, line.drawn_m, line.observed_m)]
            stamp = format_stamp(update.pose.stamp_ns)
            rows.append((stamp, line.line, line.family, *numbers, round(line.probability, 6)))
    return Table(LINE_COLUMNS, rows)


def series_of(updates: Sequence[DrawingUpdate]) -> dict[str, Series]:
    """Scales, position uncertainty, inlier ratio, and the best observation probability of each family of lines, over time."""
    stamps = np.array([u.pose.stamp_ns for u in updates], np.int64)
    values = {
        "scale_x": ([u.pose.scale_x for u in updates], "drawing units per m"),
        "scale_y": ([u.pose.scale_y for u in updates], "drawing units per m"),
        "drawing_std": ([u.pose.position_std for u in updates], "drawing units"),
        "drawing_inlier_ratio": ([u.pose.inlier_ratio for u in updates], "ratio"),
        "lines_x": ([_best(u, "x") for u in updates], "probability"),
        "lines_y": ([_best(u, "y") for u in updates], "probability"),
    }
    return {name: Series(stamps, np.array(v, np.float64), unit) for name, (v, unit) in values.items()}


def _best(update: DrawingUpdate, family: str) -> float:
    """The highest probability of a line of the family; NaN if none is in view."""
    return max((line.probability for line in update.lines if line.family == family), default=float("nan"))


def coverage_of(
    drawn: DrawnMap, scans: Sequence[PreparedScan], poses: Sequence[DrawingPose | None], sigma_m: float
) -> Mask:
    """The drawn wall cells `(rows, cols)` that some key scan has points close to."""
    rows, cols = drawn.walls.shape
    hit = np.zeros((rows, cols), np.float32)
    scale = 1.0
    for scan, pose in zip(scans, poses, strict=True):
        if pose is None:
            continue
        scale = pose.mean_scale
        cells = drawn.geometry.cells(pose.to_drawing(scan.surface))
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        hit[cells[inside, 0], cells[inside, 1]] = 1.0
    near = np.asarray(distance_to_occupied(OccupancyGrid(hit, drawn.geometry)).values, dtype=np.float64)
    return np.asarray(drawn.walls & (near < OBSERVED_SIGMAS * sigma_m * scale))


def drawing_layers(drawn: DrawnMap, observed: Mask) -> dict[str, GridLayer]:
    """Free space and walls as read from the drawing, and the walls that were observed, in the drawing frame.

    `observed` `(rows, cols)` masks the walls of the drawing that were observed.
    """
    values = {"drawing_free": drawn.free, "drawing_walls": drawn.walls, "drawing_seen": observed}
    return {name: GridLayer(v.astype(np.float32), drawn.geometry) for name, v in values.items()}


def measures_of(drawn: DrawnMap, updates: Sequence[DrawingUpdate], observed: Mask) -> dict[str, object]:
    """The scales (median over the second half of the run), the mean inlier ratio, and the fraction of walls observed.

    `observed` `(rows, cols)` masks the walls of the drawing that were observed.
    """
    reading = {"walls_are": drawn.walls_are, "is_open": drawn.is_open}
    if not updates:
        return {"drawing": reading}
    second_half = updates[len(updates) // 2 :]
    scale_x = float(np.median([u.pose.scale_x for u in second_half]))
    scale_y = float(np.median([u.pose.scale_y for u in second_half]))
    inlier_ratio = float(np.mean([u.pose.inlier_ratio for u in updates]))
    last = updates[-1].pose
    return {
        "drawing": {
            **reading,
            "scale": round((scale_x * scale_y) ** 0.5, 4),
            "scale_x": round(scale_x, 4),
            "scale_y": round(scale_y, 4),
            "inlier_ratio": round(inlier_ratio, 4),
            "matches_place": inlier_ratio >= MATCHING_INLIER_RATIO,
            "coverage": round(float(observed.sum()) / max(int(drawn.walls.sum()), 1), 4),
            "final_pose": [round(v, 4) for v in (last.x, last.y, last.yaw_rad)],
        }
    }


def picture_of(
    drawn: DrawnMap, scans: Sequence[PreparedScan], poses: Sequence[DrawingPose | None]
) -> Picture:
    """The drawing with scan points (red) and path (blue, start green) as localized in it."""
    rows, cols = drawn.walls.shape
    zoom = max(1, -(-MIN_PICTURE_PX // max(rows, cols)))
    shrink = max(1, -(-max(rows, cols) // MAX_PICTURE_PX))
    colours = np.full((rows, cols, 3), OUTSIDE_COLOUR, np.uint8)
    colours[drawn.free] = 255
    colours[drawn.walls] = WALL_COLOUR
    colours = np.repeat(np.repeat(colours, zoom, axis=0), zoom, axis=1)[::shrink, ::shrink]
    per_m = zoom / (shrink * drawn.geometry.resolution_m)
    for scan, pose in zip(scans, poses, strict=True):
        if pose is not None:
            _dot(colours, pose.to_drawing(scan.points) * per_m, MAP_COLOUR, 0)
    path = np.array([(p.x, p.y) for p in poses if p is not None]).reshape(-1, 2) * per_m
    for start, end in pairwise(path):
        count = int(np.hypot(*(end - start))) + 2
        _dot(colours, start + np.linspace(0.0, 1.0, count)[:, None] * (end - start), PATH_COLOUR, 1)
    _dot(colours, path[:1], START_COLOUR, START_DOT_PX)
    note = "Grey: drawn walls. Red: scan points, as localized in the drawing. Blue: the path."
    return Picture(np.ascontiguousarray(colours[::-1]), "In the drawing", note)


def _dot(colours: NDArray[np.uint8], places: Floats, colour: tuple[int, int, int], radius: int) -> None:
    """Square dots at places `(n, 2)` (x, y in pixels from the lower left)."""
    rows, cols = colours.shape[:2]
    centres = np.floor(places).astype(np.int64)
    for dr in range(-radius, radius + 1):
        for dc in range(-radius, radius + 1):
            col, row = centres[:, 0] + dc, centres[:, 1] + dr
            inside = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
            colours[row[inside], col[inside]] = colour
