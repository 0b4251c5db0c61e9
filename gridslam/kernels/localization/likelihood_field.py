"""Scores of poses by a distance field under the endpoints of a scan.

The field holds a byte per cell: the distance to the nearest occupied cell in steps that the caller chooses. A table of 256
entries gives the score of each distance, so that one field serves several models. Coordinates are in cells from the field's
lower-left corner; points outside the field take the last entry of the table.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.angles import cos_sin
from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.raycast import RAYS_EACH, Ray, cast
from gridslam.kernels.threads import run_in_ranges

POINTS_EACH = 100_000  # smallest number of points in a range of poses
_BLOCK = 256  # poses; their working arrays fit into the fastest cache


class VisibilityMap(NamedTuple):
    """A map for `sum_over_beams`; lengths in cells.

    `field` uint8 `(rows, cols)` holds distance steps and `boxes` the free boxes of ray casting. A wall within `tolerance` of
    a beam's endpoint does not block the beam; `slack` is how far aside the endpoint is moved to test whether the beam grazes a
    wall.
    """

    field: NDArray[np.uint8]
    boxes: NDArray[np.uint8]
    tolerance: float
    slack: float


class BeamCells(NamedTuple):
    """Beams in the robot's frame, in cells: origins `(m, 2)` and endpoints `(m, 2)`."""

    origins: NDArray[np.float64]
    endpoints: NDArray[np.float64]


def sum_over_points(
    field: NDArray[np.uint8],
    table: NDArray[np.float32],
    points: NDArray[np.float32],
    poses: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sums `(n,)` of table[field] under the points `(m, 2)`, in the robot's frame, for poses `(n, 3)` (x, y in cells, yaw)."""
    n = poses.shape[0]
    sums = np.empty(n)
    smallest = POINTS_EACH // max(len(points), 1) + 1
    run_in_ranges(_sum_over_points, n, (field, table, points, poses, sums), smallest)
    return sums


@compiled
def _sum_over_points(
    first: int,
    last: int,
    field: NDArray[np.uint8],
    table: NDArray[np.float32],
    points: NDArray[np.float32],
    poses: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `sum_over_points`.

    Block by block of poses, and within a block point by point: loops over poses without branches become vector instructions.
    """
    rows, cols = np.int32(field.shape[0]), np.int32(field.shape[1])
    steps = field.ravel()
    cos, sin, x, y, total = np.empty((5, _BLOCK), np.float32)
    cell = np.empty(_BLOCK, np.int32)  # -1 outside of the field
    for start in range(first, last, _BLOCK):
        n = min(_BLOCK, last - start)
        for j in range(n):
            c, s = cos_sin(poses[start + j, 2])
            cos[j], sin[j], total[j] = c, s, 0.0
            # One cell is added before truncation, which then equals the floor for all points inside.
            x[j], y[j] = poses[start + j, 0] + 1.0, poses[start + j, 1] + 1.0
        for k in range(points.shape[0]):
            px, py = points[k, 0], points[k, 1]
            for j in range(n):
                col = np.int32(x[j] + cos[j] * px - sin[j] * py)
                row = np.int32(y[j] + sin[j] * px + cos[j] * py)
                is_inside = (col > 0) & (col <= cols) & (row > 0) & (row <= rows)
                cell[j] = np.int32((row - 1) * cols + col - 1) if is_inside else np.int32(-1)
            for j in range(n):
                step = steps[np.uint32(max(cell[j], np.int32(0)))]
                total[j] += table[step if cell[j] >= 0 else np.uint8(255)]
        for j in range(n):
            sums[start + j] = total[j]


def sum_over_offsets(
    scores: NDArray[np.uint8], starts: NDArray[np.int32], offsets: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Sums `(h, n)` for n positions under h headings: those of the flat field `scores` at starts[i] + offsets[h, k] over k.

    `scores` is padded so that every index lies inside; `offsets` `(h, m)` are the scan's points, rotated and flattened.
    """
    headings = offsets.shape[0]
    n = starts.shape[0]
    sums = np.zeros((headings, n), np.int32)
    run_in_ranges(_sum_over_offsets, headings, (scores, starts, offsets, sums))
    return sums


@compiled
def _sum_over_offsets(
    first: int,
    last: int,
    scores: NDArray[np.uint8],
    starts: NDArray[np.int32],
    offsets: NDArray[np.int32],
    sums: NDArray[np.int32],
) -> None:
    """Fill in the items first to last - 1 of `sum_over_offsets`."""
    m = offsets.shape[1]
    n = starts.shape[0]
    for h in range(first, last):
        for i in range(n):
            start = starts[i]
            total = np.int32(0)
            for k in range(m):
                total += scores[start + offsets[h, k]]
            sums[h, i] = total


@compiled
def _is_blocked(walls: VisibilityMap, line: Ray, aside: float) -> bool:
    """Whether a wall blocks a line from (x, y) by (dx, dy) with its endpoint moved aside, up to the tolerance before it."""
    x, y, dx, dy = line
    length = np.sqrt(dx * dx + dy * dy)
    if length <= walls.tolerance:
        return False
    dx, dy = dx - aside * dy / length, dy + aside * dx / length
    moved = np.sqrt(dx * dx + dy * dy)
    free = length - walls.tolerance
    return bool(cast(walls.boxes, Ray(x, y, dx / moved, dy / moved), free) < free)


def sum_over_beams(
    walls: VisibilityMap, table: NDArray[np.float32], beams: BeamCells, poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Sums `(n,)` of the table at the endpoints of beams, for poses `(n, 3)`; a blocked beam takes its last entry.

    A beam is blocked if a wall lies farther than the tolerance before its endpoint, and also when the endpoint is moved aside by
    the slack to either side: a beam along a wall may graze it.
    """
    n = poses.shape[0]
    sums = np.empty(n)
    smallest = RAYS_EACH // max(len(beams.endpoints), 1) + 1
    run_in_ranges(_sum_over_beams, n, (walls, table, beams, poses, sums), smallest)
    return sums


@compiled
def _sum_over_beams(
    first: int,
    last: int,
    walls: VisibilityMap,
    table: NDArray[np.float32],
    beams: BeamCells,
    poses: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Fill in the items first to last - 1 of `sum_over_beams`."""
    field, origins, endpoints = walls.field, beams.origins, beams.endpoints
    rows, cols = field.shape
    m = endpoints.shape[0]
    for i in range(first, last):
        c, s = np.cos(poses[i, 2]), np.sin(poses[i, 2])
        total = 0.0
        for k in range(m):
            x = poses[i, 0] + c * endpoints[k, 0] - s * endpoints[k, 1]
            y = poses[i, 1] + s * endpoints[k, 0] + c * endpoints[k, 1]
            col, row = int(np.floor(x)), int(np.floor(y))
            value = table[255]
            if 0 <= col < cols and 0 <= row < rows:
                value = table[field[row, col]]
            if value != table[255]:
                x0 = poses[i, 0] + c * origins[k, 0] - s * origins[k, 1]
                y0 = poses[i, 1] + s * origins[k, 0] + c * origins[k, 1]
                line = Ray(x0, y0, x - x0, y - y0)
                if (
                    _is_blocked(walls, line, 0.0)
                    and _is_blocked(walls, line, walls.slack)
                    and _is_blocked(walls, line, -walls.slack)
                ):
                    value = table[255]
            total += value
        sums[i] = total
