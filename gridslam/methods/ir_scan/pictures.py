"""A picture of the raw readings beside the map made from them (figures 10 and 11 of the paper)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core import poses as se2
from gridslam.maps.occupancy import GridGeometry, OccupancyGrid
from gridslam.maps.preview import render_map
from gridslam.methods.base import Picture
from gridslam.methods.ir_scan.stops import Stop

Floats = NDArray[np.float64]

_GAP_PX = 16
_MAX_WIDTH_PX = 1400
_MAX_RANGE_RATIO = 3.0  # readings beyond this multiple of the valid range are not drawn


def raw_poses(stops: Sequence[Stop]) -> Floats:
    """Poses of the stops `(s, 3)` by odometry alone; without odometry, the predicted poses, which come from absolute poses."""
    poses = [stops[0].pose]
    for stop in stops[1:]:
        if stop.has_odometry and stop.motion is not None:
            poses.append(se2.compose(poses[-1], stop.motion.T_stop_now))
        else:
            poses.append(stop.predicted)
    return np.array(poses)


def raw_points(stops: Sequence[Stop], poses: Floats) -> Floats:
    """End points `(n, 2)` (m, map frame) of all readings as recorded, at the `poses` `(s, 3)` of the stops."""
    parts = [np.zeros((0, 2))]
    for stop, pose in zip(stops, poses, strict=True):
        if stop.scan is not None:
            scan = stop.scan
            shown = (
                np.isfinite(scan.range_m)
                & (scan.range_m > 0.0)
                & (scan.range_m < _MAX_RANGE_RATIO * scan.range_max_m)
            )
            parts.append(se2.transform_points(pose, scan.endpoints()[shown]))
    return np.concatenate(parts)


def raw_and_filtered(stops: Sequence[Stop], occupancy: OccupancyGrid) -> Picture | None:
    """Raw readings and map side by side at one scale; None without readings or map."""
    points = raw_points(stops, raw_poses(stops))
    rows, cols = occupancy.probability.shape
    if not len(points) or not rows or not cols:
        return None
    window = _window(occupancy, points)
    raw = window.probability.copy()
    raw[:] = 0.0
    cells = window.geometry.cells(points)
    inside = ((cells >= 0) & (cells < raw.shape)).all(axis=1)
    raw[cells[inside, 0], cells[inside, 1]] = 1.0
    left = render_map(OccupancyGrid(raw, window.geometry), title="raw readings", whole=True)
    right = render_map(window, title="filtered map", whole=True)
    sheet = Image.new(
        "RGB", (left.width + right.width + _GAP_PX, max(left.height, right.height)), (255, 255, 255)
    )
    sheet.paste(left, (0, 0))
    sheet.paste(right, (left.width + _GAP_PX, 0))
    sheet.thumbnail((_MAX_WIDTH_PX, _MAX_WIDTH_PX), Image.Resampling.HAMMING)
    note = (
        "Left: all readings as recorded, at the poses of odometry alone. Right: the map of the reliable readings at the "
        "matched poses."
    )
    return Picture(np.asarray(sheet, np.uint8), "Raw readings and filtered map", note)


def _window(occupancy: OccupancyGrid, points: Floats) -> OccupancyGrid:
    """The known part of the map with room for the raw readings on each side: at most half the size of the known part."""
    known = np.argwhere(~np.isnan(occupancy.probability))
    low, high = (
        (known.min(axis=0), known.max(axis=0) + 1)
        if len(known)
        else (np.zeros(2, np.int64), np.ones(2, np.int64))
    )
    cells = occupancy.geometry.cells(points)
    border = (high - low) // 2
    low = np.maximum(np.minimum(cells.min(axis=0), low), low - border)
    high = np.minimum(np.maximum(cells.max(axis=0) + 1, high), high + border)
    values = np.full(tuple(high - low), np.nan, np.float32)
    from_row, from_col = np.maximum(low, 0)
    to_row, to_col = np.minimum(high, occupancy.probability.shape)
    part = occupancy.probability[from_row:to_row, from_col:to_col]
    values[from_row - low[0] : to_row - low[0], from_col - low[1] : to_col - low[1]] = part
    g = occupancy.geometry
    origin = (
        np.array(g.origin_xy_m)
        + se2.transform_points([0.0, 0.0, g.yaw_rad], low[None, ::-1] * g.resolution_m)[0]
    )
    return OccupancyGrid(
        values, GridGeometry(g.resolution_m, (float(origin[0]), float(origin[1])), g.yaw_rad)
    )
