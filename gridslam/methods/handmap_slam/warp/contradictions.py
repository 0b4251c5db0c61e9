"""Contradictions of a fit: drawn walls between places that see each other, drawn walls where nothing was mapped, and folds.

The views of the places compare only what was mapped with the drawing. A fit that leaves a wing of the drawing empty, leads the
robot through walls, or lays two rooms over each other (a fold), costs nothing there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

CROSSED_COST = 0.75  # cost of an edge through a drawn wall: doors are displaced, and some are not drawn
# Of all drawn walls, for each place of the map. A drive that shows half of a place leaves the same half over in most fits, so
# only the difference counts; mapped walls that are not drawn cost about four times as much.
UNSEEN_COST = 1.2
SEEN_WITHIN_M = 0.5  # a drawn wall this close to a mapped one was seen
# Of all free space, for each place of the map. A drawing shows no place twice: no right fit of made drawings has a fold.
FOLDED_COST = 3.0
# Free space up to this distance from a place, one point for each cell of this size. Points of different parts of the map are
# farther apart than the last distance, and lie on each other if the drawing has them closer than the third.
FOLD_VIEW_M, FOLD_CELL_M, FOLD_NEAR_M, FOLD_FAR_M = 2.5, 0.4, 0.75, 3.0


class DrawingContradictions:
    """The contradictions between one map and one drawing."""

    def __init__(self, graph: PlaceGraph, evidence: DrawnEvidence) -> None:
        self._graph = graph
        self._evidence = evidence
        self._wall_count = max(int(evidence.walls.sum()), 1)
        self._points = np.concatenate(graph.views)
        self._owners = np.repeat(np.arange(len(graph.views)), [len(view) for view in graph.views])
        self._free_offsets, self._free_owners = _free_space(graph)

    def cost(self, states: Floats) -> float:
        """The cost of states `(p, 5)`, to be added to the costs of the places."""
        fractions = UNSEEN_COST * self.unseen_fraction(states) + FOLDED_COST * float(
            self._folded(states).mean()
        )
        return CROSSED_COST * int(self.crossed(states).sum()) + len(states) * fractions

    def folded(self, states: Floats) -> Mask:
        """Mask `(p,)` of the places in whose free space another part of the map lies, given states `(p, 5)`."""
        found = np.zeros(len(states), np.bool_)
        found[self._free_owners[self._folded(states)]] = True
        return found

    def _folded(self, states: Floats) -> Mask:
        """Mask of the points of the free space on which a point of another part of the map lies in the drawing."""
        owners, offsets = self._free_owners, self._free_offsets
        scale = float(np.exp(np.median(states[:, 3:].mean(axis=1))))
        drawn = to_drawing(states[owners], offsets)
        pairs = cKDTree(drawn).query_pairs(FOLD_NEAR_M * scale, output_type="ndarray")
        apart = (self._graph.centres[owners] + offsets)[pairs]
        found = np.zeros(len(owners), np.bool_)
        found[pairs[np.hypot(*(apart[:, 0] - apart[:, 1]).T) > FOLD_FAR_M]] = True
        return found

    def crossed(self, states: Floats) -> Mask:
        """Mask `(e,)` of the edges of the graph that go through a drawn wall, given states `(p, 5)` of the places."""
        a, b = self._graph.edges.T
        return self._evidence.crossed(states[a, :2], states[b, :2])

    def unseen_fraction(self, states: Floats) -> float:
        """The fraction of the drawn walls that lie at no mapped surface, given states `(p, 5)` of the places."""
        walls, cell = self._evidence.walls, self._evidence.cell
        cells = np.floor(to_drawing(states[self._owners], self._points) / cell).astype(np.int64)
        cells = cells[(cells >= 0).all(axis=1) & (cells < walls.shape[::-1]).all(axis=1)]
        surfaces = np.zeros(walls.shape, np.bool_)
        surfaces[cells[:, 1], cells[:, 0]] = True
        scale = float(np.exp(np.median(states[:, 3:].mean(axis=1))))
        away = distances_to(surfaces)[walls] * cell > SEEN_WITHIN_M * scale
        return int(away.sum()) / self._wall_count


def _free_space(graph: PlaceGraph) -> tuple[Floats, NDArray[np.int64]]:
    """Points of the map's free space, one in each cell: offsets `(k, 2)` from the places that own them, `(k,)`."""
    pieces = [np.concatenate([np.zeros((1, 2)), view]) for view in graph.open_views]
    owners = np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])
    offsets = np.concatenate(pieces)
    near = np.hypot(*offsets.T) < FOLD_VIEW_M
    owners, offsets = owners[near], offsets[near]
    cells = np.floor((graph.centres[owners] + offsets) / FOLD_CELL_M)
    _, first = np.unique(cells, axis=0, return_index=True)
    return offsets[first], owners[first]
