"""Observation points: few places from which all walls of a drawing are visible (handmap-slam, paper section 3.1).

The randomized art gallery: candidates are scattered over free space, ray casting lists the wall cells visible from each, and a
greedy cover repeatedly takes the candidate that sees the most uncovered wall cells. Its size is at most ln(n) + 1 times that of
the minimum cover of n wall cells (Chvatal 1979).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridslam.kernels.grids.raycast import free_squares
from gridslam.kernels.grids.visibility import visible_faces, wall_faces

Floats = NDArray[np.float64]
Cells = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Gallery:
    """The walls of a grid as targets of visibility queries; lengths in cells.

    squares: Sizes of free squares, for ray casting.
    cells: Flat indices `(n,)` of the wall cells with a free neighbour.
    face_centres: Centres `(f, 2)` (x, y) of the faces between wall cells and free cells.
    owners: Index into `cells` of each face's wall cell `(f,)`.
    """

    squares: NDArray[np.uint8]
    cells: NDArray[np.int64]
    face_centres: Floats
    owners: NDArray[np.int64]

    def visible_from(self, points: Floats, max_range: float) -> Cells:
        """Mask `(p, n)` of the wall cells that are visible within `max_range` cells from each of the `points` `(p, 2)` (x, y)."""
        places = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 2)
        return np.asarray(
            visible_faces(
                self.squares,
                places,
                face_centres=self.face_centres,
                owners=self.owners,
                count=len(self.cells),
                max_range=max_range,
            )
        )


@dataclass(frozen=True, slots=True)
class ObservationPoints:
    """Places `(k, 2)` (x, y in cells), the wall cells visible from each `(k, n)`, and those visible from no candidate `(n,)`."""

    points: Floats
    visible: Cells
    uncoverable: Cells


def gallery_of(walls: Cells, free: Cells) -> Gallery:
    """The gallery of wall cells and free cells `(rows, cols)`."""
    face_centres, owner_cells = wall_faces(np.ascontiguousarray(walls), np.ascontiguousarray(free))
    cells, owners = np.unique(owner_cells, return_inverse=True)
    squares = free_squares(np.ascontiguousarray(walls))
    return Gallery(np.asarray(squares), cells, face_centres, owners.astype(np.int64))


def choose_observation_points(
    gallery: Gallery, standable: Cells, max_range: float, count: int, rng: np.random.Generator
) -> ObservationPoints:
    """Points that together see all walls visible from any of `count` random candidates on the standable cells `(rows, cols)`."""
    candidates = scatter(standable, count, rng)
    visible = gallery.visible_from(candidates, max_range)
    chosen = greedy_cover(visible)
    return ObservationPoints(candidates[chosen], visible[chosen], np.asarray(~visible.any(axis=0)))


def scatter(standable: Cells, count: int, rng: np.random.Generator) -> Floats:
    """Centres `(m, 2)` (x, y in cells) of at most `count` different standable cells."""
    cells = np.argwhere(standable)
    if len(cells) > count:
        cells = cells[rng.permutation(len(cells))[:count]]
    return np.asarray(cells[:, ::-1] + 0.5, dtype=np.float64).reshape(-1, 2)


def greedy_cover(visible: Cells) -> NDArray[np.int64]:
    """Indices of rows of `visible` `(p, n)` that together cover every column that any row covers; ties go to the first row."""
    uncovered = visible.any(axis=0)
    counts = visible.sum(axis=1)
    chosen: list[int] = []
    while uncovered.any():
        best = int(counts.argmax())
        chosen.append(best)
        newly = visible[best] & uncovered
        uncovered &= ~newly
        counts = counts - visible[:, newly].sum(axis=1)
    return np.array(chosen, np.int64)
