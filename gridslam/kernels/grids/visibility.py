"""Visibility of wall faces from points of a grid, and counts of beams per cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.grids.raycast import Ray, cast

ZERO = 1e-9  # shorter rays have no direction
MAX_COUNT = 60000  # fits uint16


@compiled
def wall_faces(
    walls: NDArray[np.bool_], free: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Centres `(n, 2)` (x, y in cells) of the faces between wall and free cells, and the wall cells' flat indices `(n,)`."""
    rows, cols = walls.shape
    face_centres = np.empty((4 * int(walls.sum()), 2))
    cells = np.empty(len(face_centres), np.int64)
    n = 0
    for r in range(rows):
        for c in range(cols):
            if not walls[r, c]:
                continue
            for k in range(4):
                dr = 1 if k == 0 else -1 if k == 1 else 0
                dc = 1 if k == 2 else -1 if k == 3 else 0
                if 0 <= r + dr < rows and 0 <= c + dc < cols and free[r + dr, c + dc]:
                    face_centres[n, 0], face_centres[n, 1] = c + 0.5 + 0.5 * dc, r + 0.5 + 0.5 * dr
                    cells[n] = r * cols + c
                    n += 1
    return face_centres[:n].copy(), cells[:n].copy()


@compiled
def visible_faces(
    squares: NDArray[np.uint8],
    points: NDArray[np.float64],
    face_centres: NDArray[np.float64],
    owners: NDArray[np.int64],
    count: int,
    max_range: float,
) -> NDArray[np.bool_]:
    """Whether any face of each of `count` walls is visible from each point `(p, 2)`, as `(p, count)`; lengths in cells.

    Faces have centres `face_centres` `(n, 2)` and belong to the walls `owners` `(n,)`; `squares` are the largest free boxes
    about each cell, and nothing beyond `max_range` is visible. A ray to a face may end half a cell early: the cell that it hits
    first is then the next one of the same wall.
    """
    seen = np.zeros((points.shape[0], count), np.bool_)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        for k in range(face_centres.shape[0]):
            if seen[i, owners[k]]:
                continue
            dx, dy = face_centres[k, 0] - x, face_centres[k, 1] - y
            distance = np.hypot(dx, dy)
            if distance > max_range:
                continue
            if (
                distance < ZERO
                or cast(squares, Ray(x, y, dx / distance, dy / distance), distance) >= distance - 0.5
            ):
                seen[i, owners[k]] = True
    return seen


@compiled
def pass_beams(
    passed: NDArray[np.uint16],
    hit: NDArray[np.uint16],
    origin: NDArray[np.float64],
    endpoints: NDArray[np.float64],
    is_hit: NDArray[np.bool_],
    max_range: float,
    stand_off: float,
    max_gap: float,
) -> None:
    """Count in each cell `(rows, cols)` the beams that pass it and the surfaces in it; lengths in cells.

    `passed` and `hit` are changed; `is_hit` `(n,)` marks beams that end at a surface.
    Beams run from `origin` `(2,)` to `endpoints` `(n, 2)` and are followed up to `max_range`; their last `stand_off` before a
    surface is not counted as passed. Endpoints of neighbouring beams no more than `max_gap` apart are joined by a surface.
    """
    rows, cols = passed.shape
    n = endpoints.shape[0]
    for i in range(n):
        dx, dy = endpoints[i, 0] - origin[0], endpoints[i, 1] - origin[1]
        distance = np.hypot(dx, dy)
        if distance < ZERO:
            continue
        length = min(distance - stand_off if is_hit[i] else distance, max_range)
        steps = int(length)
        previous = -1
        for k in range(steps):
            t = (k + 0.5) / distance
            c, r = int(np.floor(origin[0] + t * dx)), int(np.floor(origin[1] + t * dy))
            if r < 0 or c < 0 or r >= rows or c >= cols:
                break
            cell = r * cols + c
            if cell != previous:
                passed[r, c] = min(passed[r, c] + 1, MAX_COUNT)
                previous = cell
        if not is_hit[i] or distance > max_range:
            continue
        j = i + 1 if i + 1 < n else 0
        gap = np.hypot(endpoints[j, 0] - endpoints[i, 0], endpoints[j, 1] - endpoints[i, 1])
        marks = int(2.0 * gap) + 1 if is_hit[j] and gap <= max_gap else 1
        for k in range(marks):
            u = k / marks
            c = int(np.floor(endpoints[i, 0] + u * (endpoints[j, 0] - endpoints[i, 0])))
            r = int(np.floor(endpoints[i, 1] + u * (endpoints[j, 1] - endpoints[i, 1])))
            if 0 <= r < rows and 0 <= c < cols:
                hit[r, c] = min(hit[r, c] + 1, MAX_COUNT)
