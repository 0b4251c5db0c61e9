"""What a run tells of the drawing: lines, series, layers, measures and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gridslam.core.stamps import format_stamp
from gridslam.lidar_slam.scans import PreparedScan
from gridslam.maps.distance_field import distance_to_occupied
from gridslam.maps.drawing import DrawnMap
from gridslam.maps.occupancy import GridLayer, OccupancyGrid
from gridslam.methods.base import Picture, Series, Table
from gridslam.methods.handmap_slam.drawing_pose import DrawingPose
from gridslam.methods.handmap_slam.drawing_tracker import Update
from gridslam.methods.handmap_slam.line_observation import LineObserver

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

FITTING_SHARE = 0.7  # below this mean share of points near drawn walls the drawing shows another place
SEEN_SIGMAS = 2.0
MAP_INK = (200, 60, 40)
PATH_INK = (30, 110, 200)
START_INK = (30, 150, 70)
WALL_INK = (60, 66, 76)
OUTSIDE_INK = (214, 218, 224)
LEAST_PICTURE_PX = 700
MOST_PICTURE_PX = 1600

LINE_COLUMNS = (
    "stamp", "line", "family", "x0", "y0", "x1", "y1", "drawn_m", "observed_m", "probability",
)  # fmt: skip


def line_table(updates: Sequence[Update], observer: LineObserver) -> Table:
    """One row for every drawn line in view of every update; the segment in the drawing frame, distances in metres."""
    rows = []
    for update in updates:
        for line in update.lines:
            ends = (*observer.lines.starts[line.line], *observer.lines.ends[line.line])
            numbers = [round(float(v), 3) for v in (*ends, line.drawn_m, line.observed_m)]
            stamp = format_stamp(update.pose.stamp_ns)
            rows.append((stamp, line.line, line.family, *numbers, round(line.probability, 6)))
    return Table(LINE_COLUMNS, rows)


def series_of(updates: Sequence[Update]) -> dict[str, Series]:
    """Scales, spread and fit over time, and the best observation probability of each family of lines (NaN: none in view)."""
    stamps = np.array([u.pose.stamp_ns for u in updates], np.int64)
    values = {
        "scale_x": ([u.pose.scale_x for u in updates], "drawing m per m"),
        "scale_y": ([u.pose.scale_y for u in updates], "drawing m per m"),
        "drawing_spread": ([u.pose.spread_m for u in updates], "drawing m"),
        "drawing_fit": ([u.pose.fit for u in updates], "share"),
        "lines_x": ([_best(u, "x") for u in updates], "probability"),
        "lines_y": ([_best(u, "y") for u in updates], "probability"),
    }
    return {name: Series(stamps, np.array(v, np.float64), unit) for name, (v, unit) in values.items()}


def _best(update: Update, family: str) -> float:
    return max((line.probability for line in update.lines if line.family == family), default=float("nan"))


def coverage_of(
    drawn: DrawnMap, scans: Sequence[PreparedScan], poses: Sequence[DrawingPose | None], sigma_m: float
) -> Mask:
    """The drawn wall cells `(rows, cols)` that some key scan has points near to."""
    rows, cols = drawn.walls.shape
    hit = np.zeros((rows, cols), np.float32)
    scale = 1.0
    for scan, pose in zip(scans, poses, strict=True):
        if pose is None:
            continue
        scale = (pose.scale_x * pose.scale_y) ** 0.5
        cells = drawn.geometry.cells(pose.to_drawing(scan.surface))
        inside = (cells >= 0).all(axis=1) & (cells < (rows, cols)).all(axis=1)
        hit[cells[inside, 0], cells[inside, 1]] = 1.0
    near = np.asarray(distance_to_occupied(OccupancyGrid(hit, drawn.geometry)).values, dtype=np.float64)
    return np.asarray(drawn.walls & (near < SEEN_SIGMAS * sigma_m * scale))


def drawing_layers(drawn: DrawnMap, seen: Mask) -> dict[str, GridLayer]:
    """What the drawing was read as, and what of its walls was seen, in the drawing frame."""
    values = {"drawing_free": drawn.free, "drawing_walls": drawn.walls, "drawing_seen": seen}
    return {name: GridLayer(v.astype(np.float32), drawn.geometry) for name, v in values.items()}


def measures_of(drawn: DrawnMap, updates: Sequence[Update], seen: Mask) -> dict[str, object]:
    """The hand-map scale (median over the second half of the run), how well the drawing fits, and what of it was seen."""
    reading = {"walls_are": drawn.walls_are, "is_open": drawn.is_open}
    if not updates:
        return {"drawing": reading}
    late = updates[len(updates) // 2 :]
    scale_x = float(np.median([u.pose.scale_x for u in late]))
    scale_y = float(np.median([u.pose.scale_y for u in late]))
    fit = float(np.mean([u.pose.fit for u in updates]))
    last = updates[-1].pose
    return {
        "drawing": {
            **reading,
            "scale": round((scale_x * scale_y) ** 0.5, 4),
            "scale_x": round(scale_x, 4),
            "scale_y": round(scale_y, 4),
            "fit": round(fit, 4),
            "fits": fit >= FITTING_SHARE,
            "coverage": round(float(seen.sum()) / max(int(drawn.walls.sum()), 1), 4),
            "final_pose": [round(v, 4) for v in (last.x_m, last.y_m, last.yaw_rad)],
        }
    }


def picture_of(
    drawn: DrawnMap,
    updates: Sequence[Update],
    scans: Sequence[PreparedScan],
    poses: Sequence[DrawingPose | None],
) -> Picture:
    """The drawing with what the scans saw (red) and the way (blue, start green) where the localization puts them."""
    rows, cols = drawn.walls.shape
    zoom = max(1, -(-LEAST_PICTURE_PX // max(rows, cols)))
    shrink = max(1, -(-max(rows, cols) // MOST_PICTURE_PX))
    colours = np.full((rows, cols, 3), OUTSIDE_INK, np.uint8)
    colours[drawn.free] = 255
    colours[drawn.walls] = WALL_INK
    colours = np.repeat(np.repeat(colours, zoom, axis=0), zoom, axis=1)[::shrink, ::shrink]
    per_m = zoom / (shrink * drawn.geometry.resolution_m)
    for scan, pose in zip(scans, poses, strict=True):
        if pose is not None:
            _dot(colours, pose.to_drawing(scan.points) * per_m, MAP_INK, 0)
    way = np.array([(u.pose.x_m, u.pose.y_m) for u in updates]).reshape(-1, 2) * per_m
    for start, end in pairwise(way):
        count = int(np.hypot(*(end - start))) + 2
        _dot(colours, start + np.linspace(0.0, 1.0, count)[:, None] * (end - start), PATH_INK, 1)
    _dot(colours, way[:1], START_INK, 4)
    note = "Grey: drawn walls. Red: what the scans saw, where the localization in the drawing puts it. Blue: the way."
    return Picture(np.ascontiguousarray(colours[::-1]), "In the drawing", note)


def _dot(colours: NDArray[np.uint8], places: Floats, ink: tuple[int, int, int], radius: int) -> None:
    """Square dots at places `(n, 2)` (x, y in pixels from the lower left)."""
    rows, cols = colours.shape[:2]
    at = np.floor(places).astype(np.int64)
    for dr in range(-radius, radius + 1):
        for dc in range(-radius, radius + 1):
            col, row = at[:, 0] + dc, at[:, 1] + dr
            inside = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
            colours[row[inside], col[inside]] = ink
