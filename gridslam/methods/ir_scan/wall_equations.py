"""Normal equations of readings on common walls, with the walls eliminated.

A wall segment is a cell of a coarse lattice. Its line (offset and tilt) is eliminated from the normal equations, so that only
poses remain, as in bundle adjustment. Two lattices, shifted by half a cell, share the points, so that no wall is cut by both.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray

from gridslam.kernels.infrared.wall_lines import (
    MapPoints,
    StopPoints,
    WallCriteria,
    WallEquations,
    equations_of_walls,
)
from gridslam.methods.ir_scan.stacked_readings import StackedReadings, rotated
from gridslam.sensors.infrared import RangeNoise

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LATTICE_CORNERS = (0.0, 0.5)  # corners of the two lattices, in cells
MAP_STD_M = 0.002  # standard deviation of a wall about a straight line
ROBUST_SIGMAS = 2.5  # residuals beyond it, one in a hundred by chance, lose their weight
THICKNESS_RATIO = 0.5  # largest thickness of a wall segment, as a fraction of its length
MIN_POINTS = 4.0


def wall_terms(
    poses: Floats, readings: StackedReadings, cell_m: float, noise: RangeNoise
) -> list[tuple[sparse.csr_matrix, Floats]]:
    """Hessian `(3s, 3s)` and gradient `(3s,)` of the readings on their walls, for each of the two lattices of `cell_m` (m)."""
    beams = MapPoints(
        rotated(readings.points, poses[readings.stop, 2]),
        rotated(readings.directions, poses[readings.stop, 2]),
        np.column_stack(noise.variances(readings.ranges_m)),
    )
    positions = beams.arms + poses[readings.stop, :2]
    points = StopPoints(readings.stop, positions, readings.bel, beams)
    criteria = WallCriteria(MIN_POINTS, THICKNESS_RATIO * cell_m, MAP_STD_M**2, ROBUST_SIGMAS)
    terms = []
    for corner in LATTICE_CORNERS:
        first, order = by_cell(positions, cell_m, corner)
        terms.append(eliminate_walls(equations_of_walls(first, order, points, len(poses), criteria)))
    return terms


def by_cell(points: Floats, cell_m: float, corner: float) -> tuple[Ints, Ints]:
    """Points `(n, 2)` sorted by the cell of a lattice: index of each cell's first point `(cells + 1,)`, and the order `(n,)`.

    Points in the same cell keep their order. `corner` is that of the lattice, in cells of `cell_m`.
    """
    cells = np.floor(points / cell_m + corner).astype(np.int64)
    keys = cells[:, 0] * (int(np.ptp(cells[:, 1])) + 1) + cells[:, 1]
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.diff(keys[order])) + 1
    return np.concatenate([[0], first, [len(keys)]]), order


def eliminate_walls(equations: WallEquations) -> tuple[sparse.csr_matrix, Floats]:
    """Hessian `(3s, 3s)` and gradient `(3s,)` of the poses alone: the Schur complement of all walls' offsets and tilts."""
    counts, gradient = equations.stops_of_wall, equations.pose_gradients
    w0, w1, w2 = (
        equations.wall_blocks[:, 0] + 1.0,  # + 1: the blocks of walls without points stay regular
        equations.wall_blocks[:, 1],
        equations.wall_blocks[:, 2] + 1.0,
    )
    inverse = np.stack([w2, -w1, -w1, w0], axis=1).reshape(-1, 2, 2) / (w0 * w2 - w1**2)[:, None, None]
    solved = np.repeat(inverse, counts, axis=0) @ equations.pair_blocks
    shape = (2 * len(counts), gradient.size)
    first = np.concatenate([[0], np.cumsum(np.repeat(3 * counts, 2))])
    order = _rows_of_pairs(counts)
    columns = (3 * equations.pair_stops[:, None] + np.arange(3))[order >> 1].ravel()
    B, D = (
        sparse.csr_matrix((blocks.reshape(-1, 3)[order].ravel(), columns, first), shape=shape)
        for blocks in (equations.pair_blocks, solved)
    )
    hessian = block_diagonal(equations.pose_blocks) - B.T.tocsr() @ D
    return hessian, gradient.ravel() - D.T @ equations.wall_gradients.ravel()


def block_diagonal(blocks: Floats) -> sparse.csr_matrix:
    """A matrix with the blocks `(n, 3, 3)` on its diagonal."""
    n = len(blocks)
    return sparse.bsr_matrix((blocks, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n)).tocsr()


def _rows_of_pairs(counts: Ints) -> Ints:
    """The order of the pairs' rows that puts all first rows of a wall before its second rows.

    A pair has two rows, and pairs come wall by wall; `counts` `(w,)` is the number of pairs of each wall.
    """
    total = int(counts.sum())
    wall, first = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    position = np.arange(total) + first[wall]  # of the pair's first row in the new order
    order = np.empty(2 * total, np.int64)
    order[position] = 2 * np.arange(total)
    order[position + counts[wall]] = 2 * np.arange(total) + 1
    return order
