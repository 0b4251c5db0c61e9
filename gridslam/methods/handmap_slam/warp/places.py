"""Places of a finished map as a graph: points along the drive, what is visible from each, and which neighbours see each other.

A place that the robot visits twice is one place, so a return says nothing new, and a loop is an edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from gridslam.maps.occupancy import OccupancyGrid
from gridslam.sensors.range_caster import RangeCaster, range_caster

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SPACING_M = 1.0  # distance between places
EDGE_M = 2.0  # places this close that see each other are neighbours
MAX_PLACES = 4000
BEAMS = 72
VIEW_M = 8.0
# Neighbours see each other if the ray between them ends no earlier than this before the other
MAX_UNKNOWN_M = 0.15
OCCUPIED = 0.5
# Of points before a surface, and where between
OPEN_MARGIN_M, OPEN_FRACTIONS = 0.2, np.array([0.35, 0.65, 0.9])


@dataclass(frozen=True)
class PlaceGraph:
    """Places `centres` `(p, 2)` (m, map frame) in the order of the drive.

    `parents` `(p,)` are the earlier places from which each was entered (-1: none sees it), `edges` `(e, 2)` all pairs of
    neighbours (earlier, later), those of parents included. `views` are the surfaces `(m, 2)` visible from each place, relative
    to its centre, and `open_views` points in the free space before them. `owners` `(n,)` are
    the places of the trajectory's poses.
    """

    centres: Floats
    parents: Ints
    edges: Ints
    views: list[Floats]
    open_views: list[Floats]
    owners: Ints

    @cached_property
    def neighbours(self) -> list[list[int]]:
        """The neighbours of each place, in ascending order."""
        lists: list[list[int]] = [[] for _ in range(len(self.centres))]
        for a, b in self.edges.tolist():
            lists[a].append(b)
            lists[b].append(a)
        return [sorted(each) for each in lists]

    def in_order(self, order: Ints, parents: Ints) -> PlaceGraph:
        """The same graph with its places in another order, and with other `parents` `(p,)`, numbered as they are now."""
        number = np.empty(len(order), np.int64)
        number[order] = np.arange(len(order))
        entered_from = parents[order]
        return replace(
            self,
            centres=self.centres[order],
            parents=np.where(entered_from >= 0, number[entered_from], -1),
            edges=np.sort(number[self.edges], axis=1),
            views=[self.views[k] for k in order],
            open_views=[self.open_views[k] for k in order],
            owners=number[self.owners],
        )


def place_graph(occupancy: OccupancyGrid, poses: Floats) -> PlaceGraph:
    """The places of a map along the poses `(n, 3)` of a drive."""
    occupied = np.nan_to_num(occupancy.probability, nan=0.0) > OCCUPIED
    caster = range_caster(occupied, occupancy.geometry)
    centres, parents, edges, owners = _along(caster, poses[:, :2], _grown_spacing(poses))
    bearings = np.linspace(0.0, 2.0 * np.pi, BEAMS, endpoint=False, dtype=np.float64)
    directions = np.column_stack([np.cos(bearings), np.sin(bearings)])
    at: Floats = np.column_stack([centres, np.zeros(len(centres))]).astype(np.float64)
    ranges = caster.ranges(at, bearings, np.zeros(3), VIEW_M).astype(np.float64)
    views = [r[r < VIEW_M - 0.01, None] * directions[r < VIEW_M - 0.01] for r in ranges]
    open_views = [open_points(r, directions) for r in ranges]
    return PlaceGraph(
        centres=centres, parents=parents, edges=edges, views=views, open_views=open_views, owners=owners
    )


def open_points(ranges_m: Floats, directions: Floats) -> Floats:
    """Points `(k, 2)` in the free space before surfaces at ranges `(m,)` in directions `(m, 2)`, along every fourth of them."""
    inside = np.maximum(ranges_m[::4] - OPEN_MARGIN_M, 0.0)
    return np.asarray(
        (inside[:, None, None] * OPEN_FRACTIONS[:, None] * directions[::4, None]).reshape(-1, 2)
    )


def distances_along(graph: PlaceGraph) -> Floats:
    """Distances `(p, p)` (m) along the edges."""
    a, b = graph.edges.T
    lengths = np.maximum(np.hypot(*(graph.centres[a] - graph.centres[b]).T), 1e-3)
    p = len(graph.centres)
    return np.asarray(dijkstra(coo_matrix((lengths, (a, b)), shape=(p, p)).tocsr(), directed=False))


def _grown_spacing(poses: Floats) -> float:
    """The spacing, larger on very long drives."""
    length = float(np.hypot(*np.diff(poses[:, :2], axis=0).T).sum())
    return max(SPACING_M, length / MAX_PLACES)


def _along(caster: RangeCaster, points: Floats, spacing: float) -> tuple[Floats, Ints, Ints, Ints]:
    """Centres, parents, edges and owners of the places along a path `(n, 2)`."""
    centres = np.empty((len(points), 2))
    parents: list[int] = []
    edges: list[tuple[int, int]] = []
    owners = np.empty(len(points), np.int64)
    count, current = 0, -1
    for row, point in enumerate(points):
        if count and np.hypot(*(point - centres[current])) < 0.5 * spacing:
            owners[row] = current
            continue
        distances = np.hypot(*(centres[:count] - point).T)
        near = np.flatnonzero(distances < spacing * EDGE_M)
        near = near[np.argsort(distances[near], kind="stable")]
        visible = near[_sees(caster, point, centres[near])]
        if len(visible) and distances[visible[0]] < 0.8 * spacing:
            nearest = int(visible[0])
            if current != nearest and np.hypot(*(centres[current] - centres[nearest])) < spacing * EDGE_M:
                edges.append((min(current, nearest), max(current, nearest)))
            owners[row] = current = nearest
            continue
        if current >= 0 and current not in visible:
            visible = np.append(visible, current)
        centres[count] = point
        parents.append(int(visible[0]) if len(visible) else -1)
        edges += [(int(other), count) for other in visible]
        owners[row] = current = count
        count += 1
    unique = np.unique(np.array(edges, np.int64).reshape(-1, 2), axis=0)
    return centres[:count].copy(), np.array(parents, np.int64), unique, owners


def _sees(caster: RangeCaster, point: Floats, others: Floats) -> NDArray[np.bool_]:
    """Whether there is no surface between a point and each of `others` `(n, 2)`."""
    if not len(others):
        return np.zeros(0, np.bool_)
    offsets = others - point
    lengths = np.hypot(*offsets.T)
    here = np.array([[*point, 0.0]])
    longest = max(float(lengths.max()), 0.1)
    ranges = caster.ranges(here, np.arctan2(offsets[:, 1], offsets[:, 0]), np.zeros(3), longest)[0]
    return np.asarray(ranges >= np.minimum(lengths, longest) - MAX_UNKNOWN_M)
