"""A map that has aged: a fifth of its walls is missing, a third of its furniture stands elsewhere, doors are open or shut."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gridslam.maps.occupancy import OccupancyGrid

Bools = NDArray[np.bool_]

MISSING_WALLS, MOVED_FURNITURE = 0.2, 1 / 3
WALL_PATCH_M = 2.0  # walls go missing by squares of this size
FURNITURE_M = (0.2, 1.2)  # a connected piece of this size is furniture; a smaller one is noise of the map
NEW_PER_M2 = 0.01  # boxes per square metre of floor, besides the furniture that was moved
BOX_M = (0.3, 0.9)
DOORS_PER_M2 = 0.002
DOOR_M = 0.9
OCCUPIED, FREE = 0.65, 0.3


def aged(grid: OccupancyGrid, seed: int) -> OccupancyGrid:
    """The map of a seed as it looks years later; unknown cells stay unknown."""
    rng = np.random.default_rng([seed, 17])
    probability, cell = grid.probability.copy(), grid.geometry.resolution_m
    occupied = np.nan_to_num(probability, nan=0.5) > OCCUPIED
    furniture, moved = _moved(occupied, cell, rng)
    probability[_missing(occupied & ~furniture, cell, rng) | moved] = 0.1
    free = np.argwhere(np.nan_to_num(grid.probability, nan=0.5) < FREE)
    floor_m2 = len(free) * cell**2
    boxes = int(NEW_PER_M2 * floor_m2) + _pieces(moved)
    doors = int(DOORS_PER_M2 * floor_m2)
    new = np.zeros(probability.shape, np.uint8)
    for k, (row, col) in enumerate(free[rng.integers(len(free), size=boxes + doors)].tolist()):
        size = rng.uniform(*BOX_M, 2) if k < boxes else np.array([DOOR_M, 1.5 * cell])
        corners = cv2.boxPoints(((col, row), tuple((size / cell).tolist()), float(rng.uniform(0.0, 180.0))))
        cv2.fillPoly(new, [np.rint(corners).astype(np.int32)], 1)
    probability[(new > 0) & ~np.isnan(probability)] = 0.95
    return OccupancyGrid(probability, grid.geometry)


def _moved(occupied: Bools, cell_m: float, rng: np.random.Generator) -> tuple[Bools, Bools]:
    """The cells of all furniture, and of the pieces of it that stand elsewhere now."""
    _, labels, boxes, _ = cv2.connectedComponentsWithStats(occupied.astype(np.uint8), connectivity=8)
    size = boxes[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) * cell_m
    is_furniture = (size >= FURNITURE_M[0]) & (size < FURNITURE_M[1])
    is_furniture[0] = False
    is_moved = is_furniture & (rng.random(len(size)) < MOVED_FURNITURE)
    return is_furniture[labels], is_moved[labels]


def _missing(walls: Bools, cell_m: float, rng: np.random.Generator) -> Bools:
    """The cells of walls that the map does not have: those of some of the squares of the plane."""
    side = max(int(WALL_PATCH_M / cell_m), 1)
    rows, cols = (-(-n // side) for n in walls.shape)
    chosen = np.kron(rng.random((rows, cols)) < MISSING_WALLS, np.ones((side, side), bool))
    return np.asarray(walls & chosen[: walls.shape[0], : walls.shape[1]])


def _pieces(mask: Bools) -> int:
    return int(cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)[0]) - 1
