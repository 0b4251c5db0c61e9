"""Which faces of walls are seen from which points of a grid, and what scans say of its cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.compiled import compiled
from gridslam.kernels.raycast import cast


@compiled
def wall_faces(
    walls: NDArray[np.bool_], free: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Middles `(n, 2)` (x, y in cells) of the sides between a wall cell and a free one, and the wall cell's flat index `(n,)`."""
    rows, cols = walls.shape
    middles = np.empty((4 * int(walls.sum()), 2))
    cells = np.empty(len(middles), np.int64)
    n = 0
    for r in range(rows):
        for c in range(cols):
            if not walls[r, c]:
                continue
            for k in range(4):
                dr = 1 if k == 0 else -1 if k == 1 else 0
                dc = 1 if k == 2 else -1 if k == 3 else 0
                if 0 <= r + dr < rows and 0 <= c + dc < cols and free[r + dr, c + dc]:
                    middles[n, 0], middles[n, 1] = c + 0.5 + 0.5 * dc, r + 0.5 + 0.5 * dr
                    cells[n] = r * cols + c
                    n += 1
    return middles[:n].copy(), cells[:n].copy()


@compiled
def sees_faces(
    squares: NDArray[np.uint8],
    points: NDArray[np.float64],
    middles: NDArray[np.float64],
    owners: NDArray[np.int64],
    count: int,
    reach: float,
) -> NDArray[np.bool_]:
    """Whether each point `(p, 2)` sees any face of each of `count` walls `(p, count)`; lengths in cells.

    Faces have middles `(n, 2)` and belong to the walls `owners` `(n,)`. A ray to a face may end half a cell early: what it
    touches first is then the next cell of the same wall.
    """
    seen = np.zeros((points.shape[0], count), np.bool_)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        for k in range(middles.shape[0]):
            if seen[i, owners[k]]:
                continue
            dx, dy = middles[k, 0] - x, middles[k, 1] - y
            away = np.hypot(dx, dy)
            if away > reach:
                continue
            if away < 1e-9 or cast(squares, x, y, dx / away, dy / away, away) >= away - 0.5:
                seen[i, owners[k]] = True
    return seen


@compiled
def pass_beams(
    passed: NDArray[np.uint16],
    hit: NDArray[np.uint16],
    origin: NDArray[np.float64],
    ends: NDArray[np.float64],
    is_hit: NDArray[np.bool_],
    reach: float,
    stand_off: float,
    joined: float,
) -> None:
    """Count for every cell `(rows, cols)` how many beams passed it and how many surfaces lie in it; lengths in cells.

    Beams go from `origin` `(2,)` to `ends` `(n, 2)` and are followed up to `reach`; the last `stand_off` before a surface is not
    passed. Ends of neighbouring beams that are no more than `joined` apart are joined by a surface.
    """
    rows, cols = passed.shape
    n = ends.shape[0]
    for i in range(n):
        dx, dy = ends[i, 0] - origin[0], ends[i, 1] - origin[1]
        away = np.hypot(dx, dy)
        if away < 1e-9:
            continue
        length = min(away - stand_off if is_hit[i] else away, reach)
        steps = int(length)
        before = -1
        for k in range(steps):
            t = (k + 0.5) / away
            c, r = int(np.floor(origin[0] + t * dx)), int(np.floor(origin[1] + t * dy))
            if r < 0 or c < 0 or r >= rows or c >= cols:
                break
            cell = r * cols + c
            if cell != before:
                passed[r, c] = min(passed[r, c] + 1, 60000)
                before = cell
        if not is_hit[i] or away > reach:
            continue
        j = i + 1 if i + 1 < n else 0
        gap = np.hypot(ends[j, 0] - ends[i, 0], ends[j, 1] - ends[i, 1])
        marks = int(2.0 * gap) + 1 if is_hit[j] and gap <= joined else 1
        for k in range(marks):
            u = k / marks
            c = int(np.floor(ends[i, 0] + u * (ends[j, 0] - ends[i, 0])))
            r = int(np.floor(ends[i, 1] + u * (ends[j, 1] - ends[i, 1])))
            if 0 <= r < rows and 0 <= c < cols:
                hit[r, c] = min(hit[r, c] + 1, 60000)
