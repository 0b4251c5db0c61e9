"""Walls from a map or from the picture of a plan: the outlines of what is occupied, as polygons."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gridslam.core.errors import ConfigError, MapError
from gridslam.maps.drawing import DAMAGE, FORMATS
from gridslam.maps.map_server import load_map
from gridslam.maps.occupancy import GridGeometry
from gridslam.simulation.outlines import NO_SEGMENTS, Array, polyline
from gridslam.simulation.world_config import Plan

FINER = 4  # pixels per cell when outlines are traced, so that they run along the borders of cells
OCCUPIED_FROM = 0.65
MOST_PIXELS = 25_000_000  # each is traced as FINER x FINER


def plan_segments(plan: Plan, folder: Path) -> Array:
    """Segments `(n, 4)` of a plan; its file is relative to the folder of the world file.

    Raises ConfigError: no such file, a picture without `resolution_m`, or nothing occupied in it.
    """
    path = folder / plan.file
    if path.suffix == ".yaml":
        occupied, geometry = _from_map(path)
    else:
        occupied, geometry = _from_picture(plan, path)
    if not occupied.any():
        raise ConfigError(f"{path}: no cell is occupied: nothing to make walls of (see plan.walls_are)")
    return outlines_of(occupied, geometry, plan.simplify_m)


def outlines_of(occupied: NDArray[np.bool_], geometry: GridGeometry, tolerance_m: float) -> Array:
    """The borders of occupied cells `(rows, cols)` as segments, simplified to `tolerance_m`."""
    import cv2

    fine = np.kron(np.pad(occupied, 1), np.ones((FINER, FINER), np.uint8)).astype(np.uint8)
    contours, _ = cv2.findContours(fine, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    tolerance_px = tolerance_m / geometry.resolution_m * FINER
    pieces = [NO_SEGMENTS]
    for contour in contours:
        corners = cv2.approxPolyDP(contour, tolerance_px, True).reshape(-1, 2).astype(np.float64)
        if len(corners) >= 2:
            cells = (corners + 0.5) / FINER - 1.0  # (col, row) in cells from the lower-left corner
            pieces.append(polyline(_in_map(cells, geometry), closed=len(corners) > 2))
    return np.concatenate(pieces)


def _in_map(cells: Array, geometry: GridGeometry) -> Array:
    cos, sin = np.cos(geometry.yaw_rad), np.sin(geometry.yaw_rad)
    local = cells * geometry.resolution_m
    return np.asarray(local @ np.array([[cos, sin], [-sin, cos]]) + np.asarray(geometry.origin_xy_m))


def _from_map(path: Path) -> tuple[NDArray[np.bool_], GridGeometry]:
    try:
        grid = load_map(path)
    except MapError as error:
        raise ConfigError(f"plan.file: {error}") from None
    with np.errstate(invalid="ignore"):
        return np.asarray(grid.probability >= OCCUPIED_FROM), grid.geometry


def _from_picture(plan: Plan, path: Path) -> tuple[NDArray[np.bool_], GridGeometry]:
    if plan.resolution_m is None:
        raise ConfigError(f"plan.resolution_m: the size of a pixel of {plan.file} in metres is missing")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            with Image.open(path, formats=FORMATS) as picture:
                if picture.width * picture.height > MOST_PIXELS:
                    raise ConfigError(
                        f"plan.file: {path}: {picture.width} x {picture.height} pixels, at most {MOST_PIXELS} are read; "
                        "scale the picture down and raise plan.resolution_m"
                    )
                grey = np.asarray(_on_ground(picture, plan.walls_are == "dark"))
    except (*DAMAGE, Image.DecompressionBombError) as error:
        raise ConfigError(f"plan.file: {path}: not a readable picture ({error})") from None
    is_wall = grey < 128 if plan.walls_are == "dark" else grey >= 128
    return np.ascontiguousarray(is_wall[::-1]), GridGeometry(plan.resolution_m, plan.origin)


def _on_ground(picture: Image.Image, walls_are_dark: bool) -> Image.Image:
    """The picture as grey; what is transparent counts as free."""
    layered = picture.convert("RGBA")
    free = (255, 255, 255, 255) if walls_are_dark else (0, 0, 0, 255)
    return Image.alpha_composite(Image.new("RGBA", layered.size, free), layered).convert("L")
