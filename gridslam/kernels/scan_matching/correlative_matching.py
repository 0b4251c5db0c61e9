"""Correlative matching: the pose of a scan in a likelihood field that scores best within a window.

The field's pyramid bounds the score of whole blocks of offsets from above, so that branch and bound finds the optimum
of the exhaustive search at a fraction of its cost (Olson 2009; Hess et al. 2016, sec. V-B).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled

STACK = 256  # nodes that wait in the depth-first search: at most 4 per level
LEVEL, ROW, COL, BOUND = range(4)  # columns of nodes: pyramid level, offset in cells, bound of the score


class FieldPyramid(NamedTuple):
    """`levels` uint8 `(levels, rows, cols)` of `field_pyramid`, the lower-left corner (2,) and the cell size (m)."""

    levels: NDArray[np.uint8]
    origin_xy_m: NDArray[np.float64]
    resolution_m: float


class SearchWindow(NamedTuple):
    """Offsets up to +-`offset_m` along x and y, headings up to +-`yaw_steps` multiples of `yaw_step_rad`."""

    offset_m: float
    yaw_step_rad: float
    yaw_steps: int


@compiled
def field_pyramid(field: NDArray[np.uint8], levels: int) -> NDArray[np.uint8]:
    """Pyramid `(levels, rows, cols)`: level k at (r, c) is the maximum of the field over cells [r, r + 2^k) x [c, c + 2^k).

    Outside the array the field is 0. The caller leaves a margin of 2^(levels-1) cells before the first row and column.
    """
    rows, cols = field.shape
    out = np.zeros((levels, rows, cols), np.uint8)
    for r in range(rows):
        for c in range(cols):
            out[0, r, c] = field[r, c]
    for k in range(1, levels):
        half = 1 << (k - 1)
        for r in range(rows):
            for c in range(cols):
                best = out[k - 1, r, c]
                if r + half < rows:
                    best = max(best, out[k - 1, r + half, c])
                    if c + half < cols:
                        best = max(best, out[k - 1, r + half, c + half])
                if c + half < cols:
                    best = max(best, out[k - 1, r, c + half])
                out[k, r, c] = best
    return out


@compiled
def sum_under(
    level: NDArray[np.uint8], rows: NDArray[np.int64], cols: NDArray[np.int64], dr: int, dc: int
) -> int:
    """Sum of the field under all points after an offset of (dr, dc) cells."""
    h, w = level.shape
    total = 0
    for i in range(rows.shape[0]):
        r, c = rows[i] + dr, cols[i] + dc
        if 0 <= r < h and 0 <= c < w:
            total += level[r, c]
    return total


@compiled
def _cells_under(
    pyramid: FieldPyramid,
    points: NDArray[np.float64],
    position: NDArray[np.float64],
    yaw_rad: float,
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
) -> None:
    """Fill in the cells (rows, cols) `(n,)` of the points, seen from a position (2,) under a heading."""
    origin_xy_m, resolution_m = pyramid.origin_xy_m, pyramid.resolution_m
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    for i in range(points.shape[0]):
        x = position[0] + c * points[i, 0] - s * points[i, 1] - origin_xy_m[0]
        y = position[1] + s * points[i, 0] + c * points[i, 1] - origin_xy_m[1]
        rows[i], cols[i] = int(np.floor(y / resolution_m)), int(np.floor(x / resolution_m))


@compiled
def _best_in_block(
    levels: NDArray[np.uint8],
    rows: NDArray[np.int64],
    cols: NDArray[np.int64],
    stack: NDArray[np.int64],
    window: int,
    best: int,
) -> tuple[int, int, int, bool]:
    """Depth-first branch and bound below the node stack[0], the child with the best bound first.

    Returns the best score, its offset (dr, dc), and whether it is better than `best`.
    """
    best_dr, best_dc, is_better = 0, 0, False
    depth = 1
    while depth:
        depth -= 1
        level, bound = stack[depth, LEVEL], stack[depth, BOUND]
        dr, dc = stack[depth, ROW], stack[depth, COL]
        if bound <= best:
            continue
        if level == 0:
            best, best_dr, best_dc, is_better = bound, dr, dc, True
            continue
        half = 1 << (level - 1)
        first = depth
        for quarter in range(4):
            r, c = dr + half * (quarter // 2), dc + half * (quarter % 2)
            if r > window or c > window:
                continue
            score = sum_under(levels[level - 1], rows, cols, r, c)
            if score <= best:
                continue
            j = depth
            while j > first and stack[j - 1, BOUND] > score:
                stack[j] = stack[j - 1]
                j -= 1
            stack[j, LEVEL], stack[j, BOUND] = level - 1, score
            stack[j, ROW], stack[j, COL] = r, c
            depth += 1
    return best, best_dr, best_dc, is_better


@compiled
def correlate(
    pyramid: FieldPyramid,
    points: NDArray[np.float64],
    start: NDArray[np.float64],
    search: SearchWindow,
    min_score: float,
) -> tuple[NDArray[np.float64], float]:
    """The pose (3,) in the window about `start` (3,) with the highest mean of the field (0..255) under the points `(n, 2)`.

    All whole-cell offsets and all multiples of the yaw step are searched. Returns the pose and its score; `start` and -1 if no
    pose scores more than `min_score`.
    """
    levels, resolution_m, yaw_steps = pyramid.levels, pyramid.resolution_m, search.yaw_steps
    n = points.shape[0]
    top = levels.shape[0] - 1
    block = 1 << top
    window = int(np.ceil(search.offset_m / resolution_m))
    per_axis = (2 * window) // block + 1
    n_yaw = 2 * yaw_steps + 1
    rows, cols = np.empty((n_yaw, n), np.int64), np.empty((n_yaw, n), np.int64)
    nodes = np.empty((n_yaw * per_axis * per_axis, 4), np.int64)
    for k in range(n_yaw):
        yaw = start[2] + (k - yaw_steps) * search.yaw_step_rad
        _cells_under(pyramid, points, start[:2], yaw_rad=yaw, rows=rows[k], cols=cols[k])
        for a in range(per_axis):
            for b in range(per_axis):
                dr, dc = a * block - window, b * block - window
                node = nodes[(k * per_axis + a) * per_axis + b]
                node[LEVEL], node[ROW], node[COL] = top, dr, dc
                node[BOUND] = sum_under(levels[top], rows[k], cols[k], dr, dc)
    best = int(np.floor(min_score * n))
    best_k, best_dr, best_dc = -1, 0, 0
    stack = np.empty((STACK, 4), np.int64)
    for index in np.argsort(-nodes[:, BOUND], kind="mergesort"):
        if nodes[index, BOUND] <= best:
            break
        k = index // (per_axis * per_axis)
        stack[0] = nodes[index]
        best, dr, dc, is_better = _best_in_block(
            levels, rows[k], cols[k], stack=stack, window=window, best=best
        )
        if is_better:
            best_k, best_dr, best_dc = k, dr, dc
    if best_k < 0:
        return start.copy(), -1.0
    found = np.empty(3)
    found[0] = start[0] + best_dc * resolution_m
    found[1] = start[1] + best_dr * resolution_m
    found[2] = start[2] + (best_k - yaw_steps) * search.yaw_step_rad
    return found, best / n
