"""Contradictions of a fit: drawn walls between places that see each other, and drawn walls where nothing was mapped.

The views of the places compare only what was mapped with the drawing. A fit that leaves a wing of the drawing empty, or leads
the robot through walls, costs nothing there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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


class DrawingContradictions:
    """The contradictions between one map and one drawing."""

    def __init__(self, graph: PlaceGraph, evidence: DrawnEvidence) -> None:
        self._graph = graph
        self._evidence = evidence
        self._wall_count = max(int(evidence.walls.sum()), 1)
        self._points = np.concatenate(graph.views)
        self._owners = np.repeat(np.arange(len(graph.views)), [len(view) for view in graph.views])

    def cost(self, states: Floats) -> float:
        """The cost of states `(p, 5)`, to be added to the costs of the places."""
        unseen = UNSEEN_COST * len(states) * self.unseen_fraction(states)
        return CROSSED_COST * int(self.crossed(states).sum()) + unseen

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
