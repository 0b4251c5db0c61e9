"""Exact ray casting in a grid that advances by free boxes instead of cells.

`boxes[q]` holds for every cell the side of the largest free square that has the cell in its corner and extends towards quadrant
q (0: occupied). A ray towards q advances to the point where it leaves that square. With squares of one cell this is the usual
step from cell to cell (Amanatides and Woo 1987; `grid_traversal`): the cell that is hit, and the range, are those of the full
traversal. Along a corridor a square ends at the nearer wall, and a flat ray takes many of them; so there may be boxes that are
`FLAT` times as wide as high, `boxes[4 + q]`, and as high as wide, `boxes[8 + q]`, for rays as flat or as steep as these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.threads import run_in_ranges

_PARALLEL = 1e-12  # direction cosines below this never cross a grid line
_NEVER = 1e300
_LARGEST = 255
RAYS_EACH = 4000  # smallest number of rays in a range of poses
FLAT = 4  # longer side over the shorter one of the boxes for flat and steep rays


class Ray(NamedTuple):
    """Origin (x, y) and unit direction (dx, dy): in cells from the lower-left corner of a grid, in metres among segments."""

    x: float
    y: float
    dx: float
    dy: float


def free_squares(occupied: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Sides (cells, at most 255) of the free squares `(4, rows, cols)` of a grid; no square extends beyond the grid.

    The index of a quadrant is 2 * (towards lower rows) + (towards lower columns).
    """
    squares = np.zeros((4, *occupied.shape), np.uint8)
    # One call a quadrant: a large map takes a second for each, and signals are answered only between calls.
    for quadrant in range(4):
        _free_squares_towards(quadrant, occupied, squares[quadrant])
    return squares


@compiled
def _free_squares_towards(quadrant: int, occupied: NDArray[np.bool_], squares: NDArray[np.uint8]) -> None:
    """Fill in the squares `(rows, cols)` towards a quadrant."""
    rows, cols = occupied.shape
    down, left = quadrant // 2, quadrant % 2
    dr, dc = 1 - 2 * down, 1 - 2 * left
    for i in range(rows):
        r = i if down else rows - 1 - i
        for j in range(cols):
            c = j if left else cols - 1 - j
            if occupied[r, c]:
                continue
            side = 0
            if 0 <= r + dr < rows and 0 <= c + dc < cols:
                side = min(squares[r + dr, c], squares[r, c + dc], squares[r + dr, c + dc])
            squares[r, c] = min(side + 1, _LARGEST)


def free_boxes(occupied: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """`free_squares`, and the boxes for flat and for steep rays `(12, rows, cols)`.

    The latter are given by their shorter side: 0 where not even the smallest of these is free.
    """
    boxes = np.zeros((12, *occupied.shape), np.uint8)
    for quadrant in range(4):
        _free_squares_towards(quadrant, occupied, boxes[quadrant])
        down, left = quadrant // 2, quadrant % 2
        dr, dc = 1 - 2 * down, 1 - 2 * left
        _fill_boxes(occupied, boxes[4 + quadrant], dr, FLAT * dc)
        _fill_boxes(occupied, boxes[8 + quadrant], FLAT * dr, dc)
    return boxes


@compiled
def _fill_boxes(occupied: NDArray[np.bool_], sides: NDArray[np.uint8], dr: int, dc: int) -> None:
    """Fill in the shorter sides `(rows, cols)` of the largest free boxes whose smallest one has |dr| by |dc| cells.

    The box of side n + 1 consists of the smallest box, and of the boxes of side n next to it in both directions and across.
    """
    rows, cols = occupied.shape
    for i in range(rows):
        r = i if dr < 0 else rows - 1 - i
        for j in range(cols):
            c = j if dc < 0 else cols - 1 - j
            if not (-1 <= r + dr <= rows and -1 <= c + dc <= cols) or _is_blocked(occupied, r, c, dr, dc):
                continue
            side = 0
            if 0 <= r + dr < rows and 0 <= c + dc < cols:
                side = min(sides[r + dr, c], sides[r, c + dc], sides[r + dr, c + dc])
            sides[r, c] = min(side + 1, _LARGEST)


@compiled
def _is_blocked(occupied: NDArray[np.bool_], row: int, col: int, dr: int, dc: int) -> bool:
    """Whether one of the cells of a box of |dr| by |dc| cells is occupied that has the cell in its corner."""
    for r in range(abs(dr)):
        for c in range(abs(dc)):
            if occupied[row + (r if dr > 0 else -r), col + (c if dc > 0 else -c)]:
                return True
    return False


@compiled
def cast(boxes: NDArray[np.uint8], ray: Ray, max_range: float) -> float:
    """Range (cells) along a ray to the first occupied cell; `max_range` if none is nearer.

    `boxes` are `free_squares` or `free_boxes`. A ray that starts in an occupied cell has range 0. A ray that leaves the grid, or
    starts outside of it, hits nothing.
    """
    x, y, dx, dy = ray
    planes, rows, cols = boxes.shape
    col, row = int(np.floor(x)), int(np.floor(y))
    if not (0 <= col < cols and 0 <= row < rows):
        return max_range
    left, down = dx < 0.0, dy < 0.0
    quadrant = 2 * int(down) + int(left)
    squares = boxes[quadrant]
    shaped, wide, high = squares, 1, 1
    if planes > 4 and 2.0 * abs(dy) < abs(dx):
        shaped, wide = boxes[4 + quadrant], FLAT
    elif planes > 4 and 2.0 * abs(dx) < abs(dy):
        shaped, high = boxes[8 + quadrant], FLAT
    inverse_dx = 1.0 / dx if abs(dx) > _PARALLEL else (-_NEVER if left else _NEVER)
    inverse_dy = 1.0 / dy if abs(dy) > _PARALLEL else (-_NEVER if down else _NEVER)
    t = 0.0
    while True:
        side = int(shaped[row, col])
        width, height = wide * side, high * side
        if side == 0:
            width = height = int(squares[row, col])
            if width == 0:
                return min(t, max_range)
        edge_x = col + 1 - width if left else col + width
        edge_y = row + 1 - height if down else row + height
        tx = (edge_x - x) * inverse_dx
        ty = (edge_y - y) * inverse_dy
        if tx < ty:
            t = tx
            col = edge_x - 1 if left else edge_x
            if height > 1:
                at = int(y + t * dy)
                row = min(max(at, edge_y), row) if down else max(min(at, edge_y - 1), row)
        else:
            t = ty
            row = edge_y - 1 if down else edge_y
            if width > 1:
                at = int(x + t * dx)
                col = min(max(at, edge_x), col) if left else max(min(at, edge_x - 1), col)
        if t >= max_range or not (0 <= col < cols and 0 <= row < rows):
            return max_range


def cast_rays(
    boxes: NDArray[np.uint8], poses: NDArray[np.float64], bearings: NDArray[np.float64], max_range: float
) -> NDArray[np.float32]:
    """Ranges (cells) `(n, b)` from poses `(n, 3)` (x, y in cells, yaw) along bearings `(b,)` relative to the yaw.

    `boxes` are `free_squares`, or `free_boxes`, which take three times the memory and half of the time.
    """
    n, b = poses.shape[0], bearings.shape[0]
    ranges = np.empty((n, b), np.float32)
    run_in_ranges(_cast_rays, n, (boxes, poses, bearings, max_range, ranges), RAYS_EACH // max(b, 1) + 1)
    return ranges


@compiled
def _cast_rays(
    first: int,
    last: int,
    boxes: NDArray[np.uint8],
    poses: NDArray[np.float64],
    bearings: NDArray[np.float64],
    max_range: float,
    ranges: NDArray[np.float32],
) -> None:
    """Fill in the items first to last - 1 of `cast_rays`."""
    b = bearings.shape[0]
    cos_b, sin_b = np.cos(bearings), np.sin(bearings)
    for i in range(first, last):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        for k in range(b):
            dx = c * cos_b[k] - s * sin_b[k]
            dy = s * cos_b[k] + c * sin_b[k]
            ranges[i, k] = cast(boxes, Ray(poses[i, 0], poses[i, 1], dx, dy), max_range)
