"""Free space that a submap has observed, and the fraction of another one's walls that stand in it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.tiles import TileMap
from gridslam.kernels.scan_matching.surfels import OrientedPoints, nearest_surfel

UNSEEN, FREE, NEAR_SURFACE = 0, 1, 2
STEP_CELLS = 0.7  # step along a beam
CLEAR_CELLS = 1.5  # distance before a beam's end up to which its cells are free


class SeenSpace(NamedTuple):
    """State of each cell: `cells` uint8 (rows, cols), UNSEEN, FREE or NEAR_SURFACE; lower-left corner (2,) (m), cell size."""

    cells: NDArray[np.uint8]
    corner: NDArray[np.float64]
    cell_m: float


@compiled
def mark_beams(seen: SeenSpace, beams: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
    """Mark as FREE the cells that beams `(m, 4)`, seen from `pose` (3,), cross well before their ends."""
    corner, cell_m = seen.corner, seen.cell_m
    rows, cols = seen.cells.shape
    c, s = np.cos(pose[2]), np.sin(pose[2])
    for i in range(beams.shape[0]):
        x0 = pose[0] + c * beams[i, 0] - s * beams[i, 1]
        y0 = pose[1] + s * beams[i, 0] + c * beams[i, 1]
        dx = c * (beams[i, 2] - beams[i, 0]) - s * (beams[i, 3] - beams[i, 1])
        dy = s * (beams[i, 2] - beams[i, 0]) + c * (beams[i, 3] - beams[i, 1])
        length = np.sqrt(dx * dx + dy * dy)
        steps = int((length - CLEAR_CELLS * cell_m) / (STEP_CELLS * cell_m))
        for k in range(steps + 1):
            t = STEP_CELLS * cell_m * k / max(length, 1e-9)
            row = int(np.floor((y0 + t * dy - corner[1]) / cell_m))
            col = int(np.floor((x0 + t * dx - corner[0]) / cell_m))
            if row < 0 or col < 0 or row >= rows or col >= cols:
                break
            seen.cells[row, col] = FREE


@compiled
def mark_near_surfaces(seen: SeenSpace, points: NDArray[np.float64]) -> None:
    """Mark the cells within one cell of a surface point `(n, 2)`: what lies there contradicts nothing."""
    corner, cell_m = seen.corner, seen.cell_m
    rows, cols = seen.cells.shape
    for i in range(points.shape[0]):
        row = int(np.floor((points[i, 1] - corner[1]) / cell_m))
        col = int(np.floor((points[i, 0] - corner[0]) / cell_m))
        for r in range(max(row - 1, 0), min(row + 2, rows)):
            for q in range(max(col - 1, 0), min(col + 2, cols)):
                seen.cells[r, q] = NEAR_SURFACE


@compiled
def explained_and_contradicted(
    surfels: TileMap,
    seen: SeenSpace,
    scan: OrientedPoints,
    pose: NDArray[np.float64],
    max_distance_m: float,
) -> tuple[float, float]:
    """Fractions of the points, seen from `pose` (3,), on a surface of the submap and in space that it has seen free."""
    points, normals = scan.points, scan.normals
    c, s = np.cos(pose[2]), np.sin(pose[2])
    explained = contradicted = 0
    for i in range(points.shape[0]):
        x = pose[0] + c * points[i, 0] - s * points[i, 1]
        y = pose[1] + s * points[i, 0] + c * points[i, 1]
        nx = c * normals[i, 0] - s * normals[i, 1]
        ny = s * normals[i, 0] + c * normals[i, 1]
        if nearest_surfel(surfels, x, y, nx=nx, ny=ny, max_distance_m=max_distance_m)[0] >= 0:
            explained += 1
            continue
        row = int(np.floor((y - seen.corner[1]) / seen.cell_m))
        col = int(np.floor((x - seen.corner[0]) / seen.cell_m))
        if 0 <= row < seen.cells.shape[0] and 0 <= col < seen.cells.shape[1]:
            contradicted += seen.cells[row, col] == FREE
    n = max(points.shape[0], 1)
    return explained / n, contradicted / n
