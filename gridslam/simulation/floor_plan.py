"""Walls from a map or from an image of a floor plan: the contours of the occupied cells as polygons."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import PICTURE_DAMAGE, ConfigError, MapError
from gridslam.maps.drawings.drawing import FORMATS
from gridslam.maps.image_levels import check_header
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import GridGeometry
from gridslam.simulation.geometry import NO_SEGMENTS, Array, polyline
from gridslam.simulation.world_config import FloorPlan

UPSAMPLING = 4  # pixels per cell when contours are traced, so that they follow the borders of cells
OCCUPIED_FROM = 0.65
MAX_PIXELS = 25_000_000  # before upsampling


def plan_segments(plan: FloorPlan, folder: Path) -> Array:
    """Wall segments `(n, 4)` of a floor plan; its file is relative to the folder of the world file.

    Raises ConfigError: no such file, an image without `resolution_m`, or no occupied cell.
    """
    path = folder / plan.file
    if path.suffix == ".yaml":
        occupied, geometry = _from_map(path)
    else:
        occupied, geometry = _from_image(plan, path)
    if not occupied.any():
        raise ConfigError(f"{path}: no cell is occupied: nothing to make walls of (see plan.walls_are)")
    return contour_segments(occupied, geometry, plan.simplify_m)


def contour_segments(occupied: NDArray[np.bool_], geometry: GridGeometry, tolerance_m: float) -> Array:
    """The borders of occupied cells `(rows, cols)` as segments `(n, 4)` (m), simplified to `tolerance_m`."""
    import cv2

    padded = np.pad(occupied, 1).view(np.uint8)
    fine = cv2.resize(padded, None, fx=UPSAMPLING, fy=UPSAMPLING, interpolation=cv2.INTER_NEAREST)
    contours, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    tolerance_px = tolerance_m / geometry.resolution_m * UPSAMPLING
    pieces = [NO_SEGMENTS]
    for contour in contours:
        corners = cv2.approxPolyDP(contour, tolerance_px, True).reshape(-1, 2).astype(np.float64)
        if len(corners) >= 2:
            cells = (corners + 0.5) / UPSAMPLING - 1.0  # (col, row) in cells from the lower-left corner
            pieces.append(polyline(_in_map(cells, geometry), closed=len(corners) > 2))
    return np.concatenate(pieces)


def _in_map(cells: Array, geometry: GridGeometry) -> Array:
    cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
    local = cells * geometry.resolution_m
    return np.asarray(local @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(geometry.origin_xy_m))


def _from_map(path: Path) -> tuple[NDArray[np.bool_], GridGeometry]:
    try:
        grid = load_map(path, max_cells=MAX_PIXELS)
    except MapError as error:
        raise ConfigError(f"plan.file: {error}") from None
    with np.errstate(invalid="ignore"):
        return np.asarray(grid.probability >= OCCUPIED_FROM), grid.geometry


def _from_image(plan: FloorPlan, path: Path) -> tuple[NDArray[np.bool_], GridGeometry]:
    if plan.resolution_m is None:
        raise ConfigError(f"plan.resolution_m: the size of a pixel of {plan.file} in metres is missing")
    try:
        check_header(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            with Image.open(path, formats=FORMATS) as picture:
                if picture.width * picture.height > MAX_PIXELS:
                    raise ConfigError(
                        f"plan.file: {path}: {picture.width} x {picture.height} pixels, at most {MAX_PIXELS} are read; "
                        "scale the picture down and raise plan.resolution_m"
                    )
                grey = np.asarray(_flattened(picture, plan.walls_are == "dark"))
    except (*PICTURE_DAMAGE, MapError, Image.DecompressionBombError) as error:
        raise ConfigError(f"plan.file: {path}: not a readable picture ({error})") from None
    is_wall = grey < 128 if plan.walls_are == "dark" else grey >= 128
    return np.ascontiguousarray(is_wall[::-1]), GridGeometry(plan.resolution_m, plan.origin)


def _flattened(picture: Image.Image, walls_are_dark: bool) -> Image.Image:
    """The image in grey levels; transparent pixels count as free."""
    layered = picture.convert("RGBA")
    free = (255, 255, 255, 255) if walls_are_dark else (0, 0, 0, 255)
    return Image.alpha_composite(Image.new("RGBA", layered.size, free), layered).convert("L")
