"""Walls that one passage has seen and another one has looked through.

Points that their own passage contradicts are ignored: they are walking people, glass or twigs. Small errors of the poses are
within the tolerance. Other contradictions count if they are coherent: in neighbouring cells of wall, each seen by several scans.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gridslam.lidar_slam.map_consistency.observations import Observations

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CELL_M = 0.25  # cell in which contradicted wall is counted
MIN_SCANS = 2  # smallest number of scans that must see a contradicted cell of wall
JOINED_M = 0.75  # cells this near to each other are one place


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A place of the map: its centre (m), metres of wall, and the rows of the contradicted points `(k,)`."""

    x_m: float
    y_m: float
    wall_m: float
    points: Ints


@dataclass(frozen=True, slots=True)
class Contradictions:
    """The places, largest first, and the length (m) of wall that more than one passage has seen or looked through."""

    places: list[Contradiction]
    compared_wall_m: float

    @property
    def wall_m(self) -> float:
        """Length (m) of contradicted wall."""
        return float(sum(place.wall_m for place in self.places))


def find_contradictions(observations: Observations) -> Contradictions:
    """Contradictions between the scans of different passages."""
    compared = np.flatnonzero(observations.is_compared)
    if not len(compared):
        return Contradictions([], 0.0)
    wrong = observations.is_contradicted[compared]
    cells = np.floor(observations.points[compared] / CELL_M).astype(np.int64)
    cells -= cells.min(axis=0)
    key = cells[:, 0] * (int(cells[:, 1].max()) + 1) + cells[:, 1]
    walls, cell_of, counts = np.unique(key, return_inverse=True, return_counts=True)
    wrong_counts = np.bincount(cell_of[wrong], minlength=len(walls))
    pairs = np.unique(np.column_stack([cell_of[wrong], observations.scan[compared][wrong]]), axis=0)
    scan_counts = np.bincount(pairs[:, 0], minlength=len(walls))
    doubtful = (wrong_counts > 0.5 * counts) & (scan_counts >= MIN_SCANS)
    kept = wrong & doubtful[cell_of]
    places = _places(observations.points, compared[kept], key[kept])
    return Contradictions(places, len(walls) * CELL_M)


def _places(points: Floats, rows: Ints, key: Ints) -> list[Contradiction]:
    """Contradicted points (`rows`) in cells (`key`), as coherent places."""
    if not len(rows):
        return []
    _, first, cell_of = np.unique(key, return_index=True, return_inverse=True)
    centres = points[rows[first]]
    pairs = cKDTree(centres).query_pairs(JOINED_M, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(centres),) * 2)
    _, place_of = connected_components(links, directed=False)
    places = []
    for place in range(int(place_of.max()) + 1):
        members = place_of == place
        x, y = np.median(centres[members], axis=0).tolist()
        wall_m = float(members.sum()) * CELL_M
        places.append(Contradiction(x, y, wall_m, rows[members[cell_of]]))
    return sorted(places, key=lambda place: (-place.wall_m, place.x_m, place.y_m))
