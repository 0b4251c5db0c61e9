"""The best rigid motion of a point set in a likelihood field within a window, and the best one away from it.

The field's pyramid bounds the score of whole blocks of offsets from above, so that branch and bound finds both optima of the
full search without looking at most of it (Olson 2009; Hess et al. 2016, sec. V-B).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.copying import copy_row
from gridslam.kernels.scan_matching.correlative_matching import field_pyramid, sum_under

LEVELS = 5
STACK = 4 * LEVELS  # nodes waiting in the depth-first search
YAW, ROW, COL, BOUND = range(4)  # columns of the first nodes: yaw index, offset in cells, bound of the score
LEVEL = 0  # column of waiting nodes, in the place of the yaw index, which is that of the first node


class LikelihoodField(NamedTuple):
    """`values` uint8 (rows, cols), 255 on a surface, with the lower-left corner (2,) and the cell size."""

    values: NDArray[np.uint8]
    corner: NDArray[np.float64]
    cell_m: float


class PoseWindow(NamedTuple):
    """Poses about a centre (3,), with half widths (m, m, rad) (3,) along the axes of the field."""

    centre: NDArray[np.float64]
    half_width: NDArray[np.float64]


class WindowSearch(NamedTuple):
    """Step of the headings, the lowest mean likelihood (0..1) of a match, and how far from it a rival is another place."""

    yaw_step_rad: float
    min_score: float
    rival_distance_m: float
    rival_yaw_rad: float


@compiled
def likelihood_field(
    points: NDArray[np.float64],
    corner: NDArray[np.float64],
    cells: NDArray[np.int64],
    cell_m: float,
    sigma_m: float,
) -> LikelihoodField:
    """The field exp(-d^2 / (2 sigma^2)) about the cells with points `(n, 2)`, up to two sigma; `cells` are (cols, rows)."""
    rows, cols = cells[1], cells[0]
    radius = int(np.ceil(2.0 * sigma_m / cell_m))
    size = 2 * radius + 1
    stamp = np.zeros((size, size), np.uint8)
    for r in range(size):
        for c in range(size):
            d2 = ((r - radius) ** 2 + (c - radius) ** 2) * cell_m * cell_m
            stamp[r, c] = np.uint8(np.rint(255.0 * np.exp(-0.5 * d2 / (sigma_m * sigma_m))))
    field = np.zeros((rows, cols), np.uint8)
    done = np.zeros((rows, cols), np.bool_)
    for i in range(points.shape[0]):
        row = int(np.floor((points[i, 1] - corner[1]) / cell_m))
        col = int(np.floor((points[i, 0] - corner[0]) / cell_m))
        if row < radius or col < radius or row >= rows - radius or col >= cols - radius or done[row, col]:
            continue
        done[row, col] = True
        for r in range(size):
            for c in range(size):
                value = stamp[r, c]
                if value > field[row - radius + r, col - radius + c]:
                    field[row - radius + r, col - radius + c] = value
    return LikelihoodField(field, corner, cell_m)


class Peaks(NamedTuple):
    """The best pose `(3,)`, its mean likelihood (0..1, -1: nothing found), and that of its strongest rival (-1: none)."""

    pose: NDArray[np.float64]
    score: float
    rival_score: float


class _Peak(NamedTuple):
    """A place of the search volume: yaw index, row and column offset, and the sum of the field there (-1: none)."""

    k: int
    dr: int
    dc: int
    total: int


class _Tree(NamedTuple):
    """Search space of branch and bound: the cells (rows, cols) `(yaws, n)` of all points by yaw in a pyramid of fields.

    It begins with the `nodes` `(m, 4)`, in the `order` `(m,)` of falling bounds; offsets end at `window_r` and `window_c` cells.
    """

    pyramid: NDArray[np.uint8]
    rows: NDArray[np.int32]
    cols: NDArray[np.int32]
    nodes: NDArray[np.int64]
    order: NDArray[np.int64]
    window_r: int
    window_c: int


class _Apart(NamedTuple):
    """Places farther than some cells or steps of yaw from a first peak; all places if there is none (total < 0)."""

    peak: _Peak
    cells: int
    yaw_steps: int


@compiled
def _highest(tree: _Tree, min_total: int, allowed: _Apart) -> _Peak:
    """The highest of the allowed places above `min_total`, by branch and bound."""
    pyramid, rows, cols, nodes = tree.pyramid, tree.rows, tree.cols, tree.nodes
    first, apart = allowed.peak, allowed.cells
    top = pyramid.shape[0] - 1
    best = _Peak(-1, 0, 0, min_total)
    stack = np.empty((STACK, 4), np.int64)
    for index in tree.order:
        if nodes[index, BOUND] <= best.total:
            break
        k = nodes[index, YAW]
        copy_row(stack, 0, nodes[index])
        stack[0, LEVEL] = top
        depth = 1
        while depth:
            depth -= 1
            level, bound = stack[depth, LEVEL], stack[depth, BOUND]
            dr, dc = stack[depth, ROW], stack[depth, COL]
            if bound <= best.total:
                continue
            if level == 0:
                best = _Peak(k, dr, dc, bound)
                continue
            half = 1 << (level - 1)
            base = depth
            for quarter in range(4):
                r, c = dr + half * (quarter // 2), dc + half * (quarter % 2)
                if r > tree.window_r or c > tree.window_c:
                    continue
                if first.total >= 0 and abs(k - first.k) <= allowed.yaw_steps:
                    nearest_side = r >= first.dr - apart and r + half - 1 <= first.dr + apart
                    if nearest_side and c >= first.dc - apart and c + half - 1 <= first.dc + apart:
                        continue
                score = sum_under(pyramid[level - 1], rows[k], cols[k], r, c)
                if score <= best.total:
                    continue
                j = depth
                while j > base and stack[j - 1, BOUND] > score:
                    copy_row(stack, j, stack[j - 1])
                    j -= 1
                stack[j, LEVEL], stack[j, BOUND] = level - 1, score
                stack[j, ROW], stack[j, COL] = r, c
                depth += 1
    return best


@compiled
def search_window(
    field: LikelihoodField, points: NDArray[np.float64], window: PoseWindow, search: WindowSearch
) -> Peaks:
    """The pose within the window under which the points `(n, 2)` have the highest mean likelihood, and its strongest rival.

    Searched are all whole-cell offsets and all multiples of the yaw step. Rivals are looked for down to half the best score.
    The field has a margin of 2^(LEVELS - 1) cells without surfaces at its lower and left border.
    """
    pyramid, cell_m, corner = field_pyramid(field.values, LEVELS), field.cell_m, field.corner
    start, half_width, yaw_step_rad = window.centre, window.half_width, search.yaw_step_rad
    n = points.shape[0]
    top = pyramid.shape[0] - 1
    block = 1 << top
    window_c, window_r = int(np.ceil(half_width[0] / cell_m)), int(np.ceil(half_width[1] / cell_m))
    yaw_steps = int(np.ceil(half_width[2] / yaw_step_rad))
    n_yaw = 2 * yaw_steps + 1
    per_r, per_c = (2 * window_r) // block + 1, (2 * window_c) // block + 1
    rows, cols = np.empty((n_yaw, n), np.int32), np.empty((n_yaw, n), np.int32)
    nodes = np.empty((n_yaw * per_r * per_c, 4), np.int64)
    m = 0
    for k in range(n_yaw):
        yaw = start[2] + (k - yaw_steps) * yaw_step_rad
        c, s = np.cos(yaw), np.sin(yaw)
        for i in range(n):
            x = start[0] + c * points[i, 0] - s * points[i, 1] - corner[0]
            y = start[1] + s * points[i, 0] + c * points[i, 1] - corner[1]
            rows[k, i], cols[k, i] = int(np.floor(y / cell_m)), int(np.floor(x / cell_m))
        for a in range(per_r):
            for b in range(per_c):
                dr, dc = a * block - window_r, b * block - window_c
                nodes[m, YAW], nodes[m, ROW], nodes[m, COL] = k, dr, dc
                nodes[m, BOUND] = sum_under(pyramid[top], rows[k], cols[k], dr, dc)
                m += 1
    order = np.argsort(-nodes[:, BOUND], kind="mergesort")
    full = 255.0 * n
    tree = _Tree(pyramid, rows, cols, nodes=nodes, order=order, window_r=window_r, window_c=window_c)
    anywhere = _Apart(_Peak(k=-1, dr=0, dc=0, total=-1), cells=0, yaw_steps=0)
    best = _highest(tree, int(search.min_score * full), anywhere)
    if best.k < 0:
        return Peaks(start.copy(), -1.0, -1.0)
    away = _Apart(best, int(search.rival_distance_m / cell_m), int(search.rival_yaw_rad / yaw_step_rad))
    rival = _highest(tree, best.total // 2, away)
    pose = start.copy()
    pose[0] += best.dc * cell_m
    pose[1] += best.dr * cell_m
    pose[2] += (best.k - yaw_steps) * yaw_step_rad
    return Peaks(pose, best.total / full, rival.total / full if rival.k >= 0 else -1.0)
