"""What speaks against a fit beside the places' own views: drawn walls between places that see each other, and drawn walls that no place sees.

The views ask only whether what was mapped is drawn. A fit that leaves a wing out, or leads the robot through walls, costs nothing there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gridslam.maps.distances import distances_to
from gridslam.methods.handmap_slam.warp.evidence import DrawnEvidence, to_drawing
from gridslam.methods.handmap_slam.warp.places import PlaceGraph

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

CROSSED_COST = 0.75  # of an edge through a drawn wall: doors are displaced, and some are not drawn
SAMPLES = 25  # along an edge of up to 2 m
# Of all drawn walls, for each place of the map. A drive that shows half of a place leaves the same half over in most fits, so only
# the difference counts; mapped walls that are not drawn cost about four times as much.
UNSEEN_COST = 1.2
SEEN_WITHIN_M = 0.5  # a drawn wall this close to a mapped one was seen


class Contradictions:
    """The contradictions between one map and one drawing."""

    def __init__(self, graph: PlaceGraph, evidence: DrawnEvidence) -> None:
        self._graph = graph
        self._cell = evidence.cell
        self._walls = evidence.to_wall == 0.0
        self._wall_count = max(int(self._walls.sum()), 1)
        self._points = np.concatenate(graph.views)
        self._owners = np.repeat(np.arange(len(graph.views)), [len(view) for view in graph.views])

    def cost(self, states: Floats) -> float:
        """The cost of states `(p, 5)`, to be added to the costs of the places."""
        unseen = UNSEEN_COST * len(states) * self.unseen_fraction(states)
        return CROSSED_COST * int(self.crossed(states).sum()) + unseen

    def crossed(self, states: Floats) -> Mask:
        """Which edges `(e,)` of the graph go through a drawn wall."""
        a, b = (states[ends, None, :2] for ends in self._graph.edges.T)
        along = np.linspace(0.0, 1.0, SAMPLES)[:, None]
        rows, cols, inside = self._cells(a + along * (b - a))
        return np.asarray((self._walls[rows, cols] & inside).any(axis=1))

    def unseen_fraction(self, states: Floats) -> float:
        """The fraction of the drawn walls that lie at no mapped surface."""
        rows, cols, inside = self._cells(to_drawing(states[self._owners], self._points))
        surfaces = np.zeros(self._walls.shape, np.bool_)
        surfaces[rows[inside], cols[inside]] = True
        scale = float(np.exp(np.median(states[:, 3:].mean(axis=1))))
        away = distances_to(surfaces)[self._walls] * self._cell > SEEN_WITHIN_M * scale
        return int(away.sum()) / self._wall_count

    def _cells(self, points: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64], Mask]:
        """Rows and columns of points `(..., 2)`, and which lie in the drawing."""
        cols, rows = (np.floor(points[..., k] / self._cell).astype(np.int64) for k in (0, 1))
        height, width = self._walls.shape
        inside = (rows >= 0) & (rows < height) & (cols >= 0) & (cols < width)
        return np.clip(rows, 0, height - 1), np.clip(cols, 0, width - 1), inside
