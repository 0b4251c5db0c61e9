"""Raw readings beside the map that was made of them (figures 10 and 11 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.base import Picture
from gridslam.methods.ir_scan.stops import Place

Floats = NDArray[np.float64]

_GAP_PX = 16
_WIDEST_PX = 1400
_FARTHEST = 3.0  # readings beyond so many times the valid range are not drawn


def raw_poses(places: Sequence[Place]) -> Floats:
    """Where odometry alone (or a fix, where there is none) had the places, `(p, 3)`."""
    poses = [places[0].pose]
    for place in places[1:]:
        if place.has_odometry and place.stretch is not None:
            poses.append(se2.compose(poses[-1], place.stretch.T_stop_now))
        else:
            poses.append(place.predicted)
    return np.array(poses)


def raw_points(places: Sequence[Place], poses: Floats) -> Floats:
    """End points `(n, 2)` of all readings as they were recorded, under poses of the places."""
    parts = [np.zeros((0, 2))]
    for place, pose in zip(places, poses, strict=True):
        if place.scan is not None:
            scan = place.scan
            shown = (
                np.isfinite(scan.range_m)
                & (scan.range_m > 0.0)
                & (scan.range_m < _FARTHEST * scan.range_max_m)
            )
            parts.append(se2.transform_points(pose, scan.ends()[shown]))
    return np.concatenate(parts)


def raw_and_filtered(places: Sequence[Place], made: OccupancyGrid) -> Picture | None:
    """Both side by side in one scale; None where there is nothing to see."""
    points = raw_points(places, raw_poses(places))
    rows, cols = made.probability.shape
    if not len(points) or not rows or not cols:
        return None
    window = _window(made, points)
    raw = window.probability.copy()
    raw[:] = 0.0
    cells = window.geometry.cells(points)
    inside = ((cells >= 0) & (cells < raw.shape)).all(axis=1)
    raw[cells[inside, 0], cells[inside, 1]] = 1.0
    left = render_map(OccupancyGrid(raw, window.geometry), title="raw readings")
    framed = window.probability.copy()
    for row, col in ((0, 0), (-1, -1)):  # both pictures show the whole window
        framed[row, col] = 0.0 if np.isnan(framed[row, col]) else framed[row, col]
    right = render_map(OccupancyGrid(framed, window.geometry), title="filtered map")
    sheet = Image.new(
        "RGB", (left.width + right.width + _GAP_PX, max(left.height, right.height)), (255, 255, 255)
    )
    sheet.paste(left, (0, 0))
    sheet.paste(right, (left.width + _GAP_PX, 0))
    sheet.thumbnail((_WIDEST_PX, _WIDEST_PX), Image.Resampling.HAMMING)
    note = (
        "Left: every reading as it was recorded, at the poses of odometry alone. Right: the map of the reliable readings at the "
        "matched poses."
    )
    return Picture(np.asarray(sheet, np.uint8), "Raw readings and filtered map", note)


def _window(made: OccupancyGrid, points: Floats) -> OccupancyGrid:
    """The map with a border that holds most of the raw readings: at most half its known size more to each side."""
    known = np.argwhere(~np.isnan(made.probability))
    low, high = (
        (known.min(axis=0), known.max(axis=0) + 1)
        if len(known)
        else (np.zeros(2, np.int64), np.ones(2, np.int64))
    )
    cells = made.geometry.cells(points)
    border = (high - low) // 2
    low = np.maximum(np.minimum(cells.min(axis=0), low), low - border)
    high = np.minimum(np.maximum(cells.max(axis=0) + 1, high), high + border)
    values = np.full(tuple(high - low), np.nan, np.float32)
    from_row, from_col = np.maximum(low, 0)
    to_row, to_col = np.minimum(high, made.probability.shape)
    part = made.probability[from_row:to_row, from_col:to_col]
    values[from_row - low[0] : to_row - low[0], from_col - low[1] : to_col - low[1]] = part
    g = made.geometry
    origin = (
        np.array(g.origin_xy_m)
        + se2.transform_points([0.0, 0.0, g.yaw_rad], low[None, ::-1] * g.resolution_m)[0]
    )
    return OccupancyGrid(
        values, GridGeometry(g.resolution_m, (float(origin[0]), float(origin[1])), g.yaw_rad)
    )
