"""Picture of the map with the coverage and the detections of the fixed cameras, and the estimated path."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.core.trajectory import Trajectory
from gridslam.maps.occupancy import OccupancyGrid
from gridslam.methods.base import Picture
from gridslam.sensors.floor_cells import FloorCells

Floats = NDArray[np.float64]
Pixels = NDArray[np.uint8]

_WIDEST_PX = 1400
_LARGEST_SCALE = 8
_UNKNOWN, _FREE, _WALL = (205, 205, 205), (255, 255, 255), (30, 30, 30)
_COVERED = np.array([120.0, 170.0, 235.0])
_MOVING = np.array([235.0, 120.0, 30.0])
_PATH, _START = (20, 140, 60), (20, 90, 200)


def coverage_picture(
    occupancy: OccupancyGrid, coverage: FloorCells, moving: FloorCells, path: Trajectory
) -> Picture:
    """The covered floor cells in blue, the detections in orange by their number, the path in green."""
    probability = occupancy.probability
    sheet = np.full((*probability.shape, 3), _UNKNOWN, np.uint8)
    sheet[probability < 0.5] = _FREE
    colours = sheet.astype(np.float64)
    _tint(colours, _counts(occupancy, coverage) > 0, 0.45, _COVERED)
    detections = _counts(occupancy, moving)
    opacity = 0.35 + 0.65 * np.sqrt(detections / max(detections.max(), 1.0))
    _tint(colours, detections > 0, opacity[detections > 0, None], _MOVING)
    sheet = colours.astype(np.uint8)
    sheet[probability >= 0.5] = _WALL
    scale = int(np.clip(_WIDEST_PX // max(sheet.shape[:2]), 1, _LARGEST_SCALE))
    sheet = np.ascontiguousarray(np.repeat(np.repeat(sheet, scale, 0), scale, 1))
    _draw_path(sheet, occupancy, path, scale)
    note = (
        "Blue: floor in view of a fixed camera. Orange: positions of moving objects, the robot and people alike. "
        "Green: the estimated path; it starts at the blue dot."
    )
    return Picture(np.ascontiguousarray(sheet[::-1]), "Fixed cameras: coverage and detections", note)


def _tint(colours: Floats, where: NDArray[np.bool_], opacity: float | Floats, colour: Floats) -> None:
    colours[where] = (1.0 - opacity) * colours[where] + opacity * colour


def _counts(occupancy: OccupancyGrid, cells: FloorCells) -> Floats:
    """Number of floor cells that cover each map cell `(rows, cols)`; repeated ones count repeatedly."""
    counts = np.zeros(occupancy.probability.shape)
    half_width = int(cells.size_m / occupancy.geometry.resolution_m / 2.0)
    for d_row in range(-half_width, half_width + 1):
        for d_col in range(-half_width, half_width + 1):
            offset = np.array([d_row, d_col])
            index = (
                occupancy.geometry.cells(cells.centres) + offset if len(cells) else np.zeros((0, 2), np.int64)
            )
            rows, cols = index[(index >= 0).all(axis=1) & (index < counts.shape).all(axis=1)].T
            np.add.at(counts, (rows, cols), 1.0)
    return counts


def _draw_path(sheet: Pixels, occupancy: OccupancyGrid, path: Trajectory, scale: int) -> None:
    if not len(path):
        return
    cells = occupancy.geometry.cells(path.poses[:, :2])
    points = (cells[:, ::-1] * scale + scale // 2).astype(np.int32)
    cv2.polylines(
        sheet, [points.reshape(-1, 1, 2)], False, _PATH, thickness=max(scale // 3, 1), lineType=cv2.LINE_AA
    )
    cv2.circle(
        sheet, tuple(points[0].tolist()), scale + 1, _START, thickness=cv2.FILLED, lineType=cv2.LINE_AA
    )
