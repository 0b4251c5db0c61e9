"""Exact ray casting against line segments and circles.

Static segments are kept in a uniform grid of buckets, which a ray traverses cell by cell (Amanatides and Woo 1987) until the
nearest hit lies before the next cell. Moving shapes (few segments, few circles) are tested one by one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.grid_traversal import Traversal, advance
from gridslam.kernels.grids.raycast import Ray
from gridslam.kernels.threads import run_in_ranges

_PARALLEL = 1e-14
_NEVER = 1e300
_SLACK = 1e-9  # relative overlap at the ends of segments, so that no ray slips through a corner


class BucketGrid(NamedTuple):
    """A grid of square buckets: lower left corner (m), side (m), and numbers of rows and columns."""

    x: float
    y: float
    size: float
    rows: int
    cols: int


@compiled
def _cell_span(low: float, high: float, origin: float, size: float, count: int) -> tuple[int, int]:
    """First and last cell that [low, high] touches, one more on each side against rounding."""
    first = int(np.floor((low - origin) / size - 1e-6))
    last = int(np.floor((high - origin) / size + 1e-6))
    return min(max(first, 0), count - 1), min(max(last, 0), count - 1)


@compiled
def _touches(segment: NDArray[np.float64], x: float, y: float, half: float) -> bool:
    """Whether a segment meets the square of half side `half` about (x, y); their bounding boxes are known to overlap."""
    dx, dy = segment[2] - segment[0], segment[3] - segment[1]
    distance = abs(dx * (y - segment[1]) - dy * (x - segment[0]))
    return bool(distance <= half * (abs(dx) + abs(dy)) * (1.0 + 1e-6) + 1e-12)


@compiled
def fill_buckets(
    segments: NDArray[np.float64], grid: BucketGrid
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Segments `(n, 4)` by cell: cell c (row * cols + col) holds items[starts[c]:starts[c + 1]]."""
    origin_x, origin_y, size, rows, cols = grid.x, grid.y, grid.size, grid.rows, grid.cols
    starts = np.zeros(rows * cols + 1, np.int32)
    items = np.zeros(0, np.int32)
    for fill in range(2):
        heads = starts[:-1].copy()
        for i in range(segments.shape[0]):
            s = segments[i]
            c0, c1 = _cell_span(min(s[0], s[2]), max(s[0], s[2]), origin_x, size, cols)
            r0, r1 = _cell_span(min(s[1], s[3]), max(s[1], s[3]), origin_y, size, rows)
            for row in range(r0, r1 + 1):
                for col in range(c0, c1 + 1):
                    x, y = origin_x + (col + 0.5) * size, origin_y + (row + 0.5) * size
                    if not _touches(s, x, y, 0.5 * size * 1.0001):
                        continue
                    cell = row * cols + col
                    if fill:
                        items[heads[cell]] = i
                        heads[cell] += 1
                    else:
                        starts[cell + 1] += 1
        if not fill:
            starts = np.cumsum(starts).astype(np.int32)
            items = np.zeros(starts[-1], np.int32)
    return starts, items


@compiled
def _segment_distance(s: NDArray[np.float64], ox: float, oy: float, dx: float, dy: float) -> float:
    """Distance along the ray to a segment, or _NEVER."""
    ex, ey = s[2] - s[0], s[3] - s[1]
    cross = dx * ey - dy * ex
    if abs(cross) < _PARALLEL:
        return _NEVER
    wx, wy = s[0] - ox, s[1] - oy
    fraction = (wx * dy - wy * dx) / cross
    if fraction < -_SLACK or fraction > 1.0 + _SLACK:
        return _NEVER
    distance = float((wx * ey - wy * ex) / cross)
    return distance if distance >= 0.0 else _NEVER


@compiled
def _circle_distance(c: NDArray[np.float64], ox: float, oy: float, dx: float, dy: float) -> float:
    """Distance along the ray to a circle (x, y, radius), from outside or inside, or _NEVER."""
    wx, wy = c[0] - ox, c[1] - oy
    along = float(wx * dx + wy * dy)
    square = c[2] * c[2] - (wx * wx + wy * wy - along * along)
    if square < 0.0:
        return _NEVER
    half = float(np.sqrt(square))
    if along - half >= 0.0:
        return along - half
    return along + half if along + half >= 0.0 else _NEVER


@compiled
def _entry(o: float, d: float, low: float, high: float) -> tuple[float, float]:
    """Distances at which a ray enters and leaves a slab."""
    if abs(d) < _PARALLEL:
        return (-_NEVER, _NEVER) if low <= o <= high else (_NEVER, -_NEVER)
    a, b = (low - o) / d, (high - o) / d
    return min(a, b), max(a, b)


@compiled
def _cast_static(
    segments: NDArray[np.float64],
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    grid: BucketGrid,
    ray: Ray,
    max_range: float,
) -> tuple[float, int]:
    """Distance and index of the nearest static segment; (`max_range`, -1) if there is none."""
    x0, y0, size, rows, cols = grid.x, grid.y, grid.size, grid.rows, grid.cols
    ox, oy, dx, dy = ray
    in_x, out_x = _entry(ox, dx, x0, x0 + cols * size)
    in_y, out_y = _entry(oy, dy, y0, y0 + rows * size)
    t, last = max(in_x, in_y, 0.0), min(out_x, out_y, max_range)
    best, index = max_range, -1
    if t > last:
        return best, index
    col = min(max(int(np.floor((ox + t * dx - x0) / size)), 0), cols - 1)
    row = min(max(int(np.floor((oy + t * dy - y0) / size)), 0), rows - 1)
    step_row, step_col = (1 if dy > 0 else -1), (1 if dx > 0 else -1)
    per_row = size / abs(dy) if abs(dy) > _PARALLEL else _NEVER
    per_col = size / abs(dx) if abs(dx) > _PARALLEL else _NEVER
    next_row = (y0 + (row + (dy > 0)) * size - oy) / dy if abs(dy) > _PARALLEL else _NEVER
    next_col = (x0 + (col + (dx > 0)) * size - ox) / dx if abs(dx) > _PARALLEL else _NEVER
    line = Traversal(
        row=row,
        col=col,
        step_row=step_row,
        step_col=step_col,
        next_row=next_row,
        next_col=next_col,
        per_row=per_row,
        per_col=per_col,
    )
    while 0 <= line.row < rows and 0 <= line.col < cols:
        cell = line.row * cols + line.col
        for k in range(starts[cell], starts[cell + 1]):
            distance = _segment_distance(segments[items[k]], ox, oy, dx, dy)
            if distance < best:
                best, index = distance, int(items[k])
        leave = min(line.next_col, line.next_row)
        if best <= leave or leave >= last:
            return best, index
        line = advance(line)
    return best, index


def cast_segments(
    segments: NDArray[np.float64],
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    grid: BucketGrid,
    moving: NDArray[np.float64],
    circles: NDArray[np.float64],
    rays: NDArray[np.float64],
    max_range: float,
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.float64]]:
    """Cast rays `(m, 4)` (origin x, y, unit direction x, y) up to `max_range` (m).

    Bucket b of the `grid` holds the static segments items[starts[b]:starts[b + 1]].
    Returns the distances `(m,)` (`max_range` if nothing is hit), the index of the shape that is hit `(m,)` (static segments,
    then moving segments `(k, 4)`, then circles `(c, 3)`; -1 for none), and the cosine of the angle of incidence `(m,)`.
    """
    m = rays.shape[0]
    ranges, hits, cosines = np.empty(m), np.empty(m, np.int32), np.ones(m)
    run_in_ranges(
        _cast_segments,
        m,
        (segments, starts, items, grid, moving, circles, rays, max_range, ranges, hits, cosines),
    )
    return ranges, hits, cosines


@compiled
def _cast_segments(
    first: int,
    last: int,
    segments: NDArray[np.float64],
    starts: NDArray[np.int32],
    items: NDArray[np.int32],
    grid: BucketGrid,
    moving: NDArray[np.float64],
    circles: NDArray[np.float64],
    rays: NDArray[np.float64],
    max_range: float,
    ranges: NDArray[np.float64],
    hits: NDArray[np.int32],
    cosines: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `cast_segments`."""
    n, k = segments.shape[0], moving.shape[0]
    for i in range(first, last):
        ox, oy, dx, dy = rays[i, 0], rays[i, 1], rays[i, 2], rays[i, 3]
        best, index = _cast_static(
            segments, starts, items, grid=grid, ray=Ray(ox, oy, dx, dy), max_range=max_range
        )
        for j in range(k):
            distance = _segment_distance(moving[j], ox, oy, dx, dy)
            if distance < best:
                best, index = distance, n + j
        for j in range(circles.shape[0]):
            distance = _circle_distance(circles[j], ox, oy, dx, dy)
            if distance < best:
                best, index = distance, n + k + j
        ranges[i], hits[i] = best, index
        if index >= n + k:
            circle = circles[index - n - k]
            nx, ny = ox + best * dx - circle[0], oy + best * dy - circle[1]
            cosines[i] = abs(nx * dx + ny * dy) / max(np.hypot(nx, ny), 1e-12)
        elif index >= 0:
            s = segments[index] if index < n else moving[index - n]
            ex, ey = s[2] - s[0], s[3] - s[1]
            cosines[i] = abs(dx * ey - dy * ex) / max(np.hypot(ex, ey), 1e-12)
