"""Observation points: few places from which all walls of a drawing are seen (handmap-slam, paper section 3.1).

The randomized art gallery: candidates are scattered over free space, ray tracing lists the wall cells that each one sees, and
the greedy cover takes the candidate that sees most of what is not seen yet. Its size is within ln(n) + 1 of the least cover
(Chvatal 1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.raycast import free_squares
from gridslam.kernels.sight_lines import sees_faces, wall_faces

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Gallery:
    """The walls of a grid as things to be seen; lengths in cells.

    `cells` `(n,)` are the flat indices of the wall cells with a free neighbour; the faces between have middles `(f, 2)` (x, y)
    and belong to the cells `owners` `(f,)`.
    """

    squares: NDArray[np.uint8]
    cells: NDArray[np.int64]
    middles: Floats
    owners: NDArray[np.int64]

    def seen_from(self, points: Floats, reach: float) -> Cells:
        """Which wall cells `(p, n)` are seen from points `(p, 2)` (x, y) within a reach."""
        places = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
        return np.asarray(sees_faces(self.squares, places, self.middles, self.owners, len(self.cells), reach))


@dataclass(frozen=True, slots=True)
class ObservationPoints:
    """Places `(k, 2)` (x, y in cells), the wall cells that each sees `(k, n)`, and those that no candidate sees `(n,)`."""

    points: Floats
    sees: Cells
    uncoverable: Cells


def gallery_of(walls: Cells, free: Cells) -> Gallery:
    """The gallery of wall cells and free cells `(rows, cols)`."""
    middles, owner_cells = wall_faces(np.ascontiguousarray(walls), np.ascontiguousarray(free))
    cells, owners = np.unique(owner_cells, return_inverse=True)
    squares = free_squares(np.ascontiguousarray(walls))
    return Gallery(np.asarray(squares), cells, middles, owners.astype(np.int64))


def choose_observation_points(
    gallery: Gallery, standable: Cells, reach: float, count: int, rng: np.random.Generator
) -> ObservationPoints:
    """Scatter `count` candidates over the standable cells `(rows, cols)` and cover all walls that they see."""
    candidates = scatter(standable, count, rng)
    sees = gallery.seen_from(candidates, reach)
    chosen = greedy_cover(sees)
    return ObservationPoints(candidates[chosen], sees[chosen], np.asarray(~sees.any(axis=0)))


def scatter(standable: Cells, count: int, rng: np.random.Generator) -> Floats:
    """Centres `(m, 2)` (x, y in cells) of at most `count` different standable cells."""
    cells = np.argwhere(standable)
    if len(cells) > count:
        cells = cells[rng.permutation(len(cells))[:count]]
    return np.asarray(cells[:, ::-1] + 0.5, dtype=np.float64).reshape(-1, 2)


def greedy_cover(sees: Cells) -> NDArray[np.int64]:
    """Rows of `sees` `(p, n)` that together see all that any row sees; of equals the first."""
    left = sees.any(axis=0)
    counts = sees.sum(axis=1)
    chosen: list[int] = []
    while left.any():
        best = int(counts.argmax())
        chosen.append(best)
        newly = sees[best] & left
        left &= ~newly
        counts = counts - sees[:, newly].sum(axis=1)
    return np.array(chosen, np.int64)
