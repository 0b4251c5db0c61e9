"""Walls that one passage has seen and another one has looked through.

What a passage contradicts itself is left out: people who walk, glass, twigs. Small errors of the poses are within the tolerance.
What is left counts where it is coherent: neighbouring cells of wall, each seen by several scans.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from gridslam.core import poses as se2
from gridslam.kernels import free_space
from gridslam.lidar_slam.map_consistency.passages import Passages
from gridslam.lidar_slam.scans import PreparedScan

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

SECTORS = 256
MAX_POINTS = 160  # of a scan that others are asked about
TOLERANCES = free_space.Tolerances(0.3, 0.01, 15.0)
CELL_M = 0.25  # of wall
MIN_SCANS = 2  # that see a cell of wall which others look through
JOINED_M = 0.75  # cells this near to each other are one place


@dataclass(frozen=True, slots=True)
class Contradiction:
    """A place of the map: its centre (m), metres of wall, and two of the scans that contradict each other."""

    x_m: float
    y_m: float
    wall_m: float
    seen_by: int
    looked_through_by: int


@dataclass(frozen=True, slots=True)
class Contradictions:
    """The places, largest first, and metres of wall that more than one passage has seen or looked through."""

    places: list[Contradiction]
    compared_wall_m: float


@dataclass(frozen=True, slots=True)
class _Points:
    """Points in the map frame `(m, 2)`, the rows of their scans `(m,)`, and what other scans say of them."""

    positions: Floats
    scan: Ints
    testimony: free_space.Testimony

    @property
    def is_compared(self) -> Bools:
        """Whether another passage says anything, and the own one does not see through the point."""
        said = self.testimony.free_by_others + self.testimony.occupied_by_others > 0
        return np.asarray(said & (self.testimony.free_by_own == 0))

    @property
    def is_contradicted(self) -> Bools:
        """Whether most of the other passages that say anything see the point free."""
        return np.asarray(
            self.is_compared & (self.testimony.free_by_others > self.testimony.occupied_by_others)
        )


def find_contradictions(scans: Sequence[PreparedScan], poses: Floats, passages: Passages) -> Contradictions:
    """Contradictions between scans `(n,)` of different passages, seen from their poses `(n, 3)`."""
    points = _testimony(scans, poses, passages)
    compared, contradicted = points.is_compared, points.is_contradicted
    cells = np.floor(points.positions / CELL_M).astype(np.int64)
    if not compared.any():
        return Contradictions([], 0.0)
    cells -= cells.min(axis=0)
    key = cells[:, 0] * (int(cells[:, 1].max()) + 1) + cells[:, 1]
    walls, cell_of, counts = np.unique(key[compared], return_inverse=True, return_counts=True)
    wrong = contradicted[compared]
    wrong_counts = np.bincount(cell_of[wrong], minlength=len(walls))
    pairs = np.unique(np.column_stack([cell_of[wrong], points.scan[compared][wrong]]), axis=0)
    scan_counts = np.bincount(pairs[:, 0], minlength=len(walls))
    doubtful = (wrong_counts > 0.5 * counts) & (scan_counts >= MIN_SCANS)
    rows = np.flatnonzero(compared)[wrong & doubtful[cell_of]]
    return Contradictions(_places(points, rows, key[rows], passages), len(walls) * CELL_M)


def _testimony(scans: Sequence[PreparedScan], poses: Floats, passages: Passages) -> _Points:
    viewpoints = np.array([scan.viewpoint for scan in scans])
    returns = [scan.returns for scan in scans]
    profiles = free_space.Profiles(
        *free_space.scan_profiles(np.concatenate(returns), _offsets(returns), viewpoints, SECTORS)
    )
    chosen = [scan.subset(MAX_POINTS).points for scan in scans]
    first = _offsets(chosen)
    points = np.concatenate(chosen)
    testimony = free_space.testimony(
        points, first, poses, viewpoints, profiles, passages.partners, TOLERANCES
    )
    positions = [se2.transform_points(pose, p) for pose, p in zip(poses, chosen, strict=True)]
    return _Points(np.concatenate(positions), np.repeat(np.arange(len(scans)), np.diff(first)), testimony)


def _places(points: _Points, rows: Ints, key: Ints, passages: Passages) -> list[Contradiction]:
    """Contradicted points (`rows`) in cells (`key`), as coherent places."""
    if not len(rows):
        return []
    _, first, cell_of = np.unique(key, return_index=True, return_inverse=True)
    centres = points.positions[rows[first]]
    pairs = cKDTree(centres).query_pairs(JOINED_M, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(centres),) * 2)
    _, place_of = connected_components(links, directed=False)
    places = []
    for place in range(int(place_of.max()) + 1):
        members = place_of == place
        x, y = np.median(centres[members], axis=0).tolist()
        seen_by = int(points.scan[rows[place_of[cell_of] == place]].min())
        other = passages.farthest_partner(seen_by)
        places.append(Contradiction(x, y, float(members.sum()) * CELL_M, seen_by, other))
    return sorted(places, key=lambda place: (-place.wall_m, place.x_m, place.y_m))


def _offsets(parts: Sequence[Floats]) -> Ints:
    first = np.zeros(len(parts) + 1, np.int64)
    np.cumsum([len(part) for part in parts], out=first[1:])
    return first
