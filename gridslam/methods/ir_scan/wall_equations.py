"""Normal equations of readings on common walls, with the walls eliminated.

A wall segment is fitted to the points in a cell of a coarse lattice. Its line (offset and tilt) is eliminated from the normal
equations, so that only poses remain, as in bundle adjustment. There are two lattices with all points, half a cell apart, so that
a wall that is cut by the border of a cell in one of them is whole in the other.
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
WALL_STD_M = 0.002  # standard deviation of a wall about a straight line
ROBUST_SIGMAS = 2.5  # residuals beyond it, one in a hundred by chance, lose their weight
THICKNESS_RATIO = 0.5  # largest thickness of a wall segment, as a fraction of a cell of the lattice
MIN_POINTS = 4.0  # smallest number of points of a wall segment


def wall_terms(
    poses: Floats, readings: StackedReadings, cell_m: float, noise: RangeNoise
) -> list[tuple[sparse.csr_matrix, Floats]]:
    """Hessian `(3s, 3s)` and gradient `(3s,)` of the readings on their walls, for each of the two lattices.

    `poses` `(s, 3)` are those of the stops; the lattices have cells of `cell_m` (m).
    """
    beams = MapPoints(
        rotated(readings.points, poses[readings.stop, 2]),
        rotated(readings.directions, poses[readings.stop, 2]),
        np.column_stack(noise.variances(readings.ranges_m)),
    )
    positions = beams.arms + poses[readings.stop, :2]
    points = StopPoints(readings.stop, positions, readings.bel, beams)
    criteria = WallCriteria(MIN_POINTS, THICKNESS_RATIO * cell_m, WALL_STD_M**2, ROBUST_SIGMAS)
    terms = []
    for corner in LATTICE_CORNERS:
        first, order = by_cell(positions, cell_m, corner)
        terms.append(eliminate_walls(equations_of_walls(first, order, points, len(poses), criteria)))
    return terms


def by_cell(points: Floats, cell_m: float, corner: float) -> tuple[Ints, Ints]:
    """Points `(n, 2)` (m) grouped by the cells of a lattice.

    Returns the index of the first point of each cell in the new order, followed by n, `(cells + 1,)`, and the order `(n,)`.
    Points in the same cell keep their order. `corner` is the offset of the lattice in cells of `cell_m`.
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
    """The order of the rows of pairs (wall, stop) that puts all first rows of a wall before its second rows.

    A pair has two rows, for the wall's offset and tilt. Pairs come wall by wall; `counts` `(w,)` is the number of each wall's
    pairs.
    """
    total = int(counts.sum())
    wall, first = np.repeat(np.arange(len(counts)), counts), np.cumsum(counts) - counts
    position = np.arange(total) + first[wall]  # of the pair's first row in the new order
    order = np.empty(2 * total, np.int64)
    order[position] = 2 * np.arange(total)
    order[position + counts[wall]] = 2 * np.arange(total) + 1
    return order
